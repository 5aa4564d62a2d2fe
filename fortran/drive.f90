!> The drive of a slider: the value that it prescribes over time, and its work.
!>
!> A drive prescribes a value: the displacement of the end of a spring, or of the slider itself [m],
!> or a force [N]. Its rate is in m/s or N/s, its acceleration in m/s2 or N/s2. A run has parts of
!> constant acceleration; a stage is one part or several. A slider has a drive, and adds its
!> impulse; the loop asks when the drive changes.
module mesoslip_drive
   use mesoslip_extremes, only: extremes_type
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: drive_type

   !> A drive in parts of constant acceleration.
   type :: drive_type
      !> A time [s], the value then (a displacement from the moving origin), and the rate then
      real(wp) :: time = 0.0_wp, value = 0.0_wp, rate = 0.0_wp
      !> Acceleration since then
      real(wp) :: acceleration = 0.0_wp
      !> Time at which the rate changes sign [s]; steps end there
      real(wp) :: turn = huge(1.0_wp)
      !> Sign of the rate until then, or of the last rate that was not 0
      real(wp) :: direction = 1.0_wp
      !> Impulse on the slider since the drive has its constant velocity [N s]; times the velocity
      !> it is the work since then. It is not used while the drive accelerates, or is a force.
      type(accumulator_type) :: impulse
      !> Other work [J]; other impulse in the current stage [N s]
      type(accumulator_type) :: earlier_work, earlier_impulse
      !> Sum of the sizes of its parts [J], which do not cancel where the drive returns
      real(wp), private :: earlier_gross_work = 0.0_wp
      !> Maximum and minimum of the force on the slider in the current stage
      type(extremes_type) :: extremes

      !> Current part; for each part its end [s], the rates at its start and at its end, the number
      !> of its stage; shape (parts)
      integer, private :: part = 1
      real(wp), allocatable, private :: part_end(:), start_rate(:), end_rate(:)
      integer, allocatable, private :: stage_of_part(:)
      !> Value at the start of each part, if it may jump there
      real(wp), allocatable, private :: start_value(:)
   contains
      !> Set the parts, and their start values
      procedure, non_overridable :: open, set_values, is_open
      !> Start the first part or the next, return to the first, reverse within a part
      procedure, non_overridable :: begin, take_next_part, rewind, turn_round
      !> Time at which the part ends, or the drive changes
      procedure, non_overridable :: end_of_part, next_change
      !> Whether the current part is the last one, and whether the next is of another stage
      procedure, non_overridable :: is_last_part, is_stage_over
      !> Number of the current stage, start of a stage, and impulse on the slider in it
      procedure, non_overridable :: stage, begin_stage, stage_impulse
      !> Set rate and acceleration; value and rate at a time; work done so far
      procedure, non_overridable :: change, at, rate_at, work
      !> Add to the work, and the sum of the sizes of its parts
      procedure, non_overridable :: add_work, gross_work
      !> Move the time and the origin of the value
      procedure, non_overridable :: rebase
      !> Write the state to an archive, or read it
      procedure, non_overridable :: exchange
   end type drive_type

contains

   !> Set the parts of a drive.
   subroutine open(self, part_end, start_rate, end_rate, stage_of_part, error)
      class(drive_type), intent(inout) :: self
      !> End of each part [s]; rates at its start and at its end
      real(wp), intent(in) :: part_end(:), start_rate(:), end_rate(:)
      !> Number of the stage that each part is of
      integer, intent(in) :: stage_of_part(:)
      !> Set without a part
      type(error_type), allocatable, intent(out) :: error

      if (size(part_end) == 0) then
         call raise(error, status_invalid, "a drive has one part at least")
         return
      end if
      self%part_end = part_end
      self%start_rate = start_rate
      self%end_rate = end_rate
      self%stage_of_part = stage_of_part
   end subroutine open

   !> Set the values at which the parts start; without them the value is continuous.
   subroutine set_values(self, start_value, error)
      class(drive_type), intent(inout) :: self
      !> Value at the start of each part
      real(wp), intent(in) :: start_value(:)
      !> Set if their number is not that of the parts, or there are no parts yet
      type(error_type), allocatable, intent(out) :: error

      if (.not. self%is_open()) then
         call raise(error, status_invalid, "the parts of a drive come before their values")
      else if (size(start_value) /= size(self%part_end)) then
         call raise(error, status_invalid, "each part of a drive has one value at its start")
      else
         self%start_value = start_value
      end if
   end subroutine set_values

   !> Whether the parts are set.
   pure function is_open(self)
      class(drive_type), intent(in) :: self
      logical :: is_open

      is_open = allocated(self%part_end)
   end function is_open

   !> Start the first part.
   subroutine begin(self, time)
      class(drive_type), intent(inout) :: self
      !> Time now [s]
      real(wp), intent(in) :: time

      self%part = 1
      call take_part(self, time)
   end subroutine begin

   !> Start the next part; there is one.
   subroutine take_next_part(self, time)
      class(drive_type), intent(inout) :: self
      !> Time now [s]
      real(wp), intent(in) :: time

      self%part = self%part + 1
      call take_part(self, time)
   end subroutine take_next_part

   !> Return to the first part, but keep the rate.
   pure subroutine rewind(self)
      class(drive_type), intent(inout) :: self

      self%part = 1
   end subroutine rewind

   !> Set rate and acceleration to those of the current part.
   subroutine take_part(self, time)
      type(drive_type), intent(inout) :: self
      real(wp), intent(in) :: time

      associate (start => self%start_rate(self%part), end => self%end_rate(self%part))
         call self%change(time, start, part_acceleration(self))
         ! A ramp to rest does not turn: its time of rest may be rounded below its end.
         if (.not. start * end < 0.0_wp) self%turn = huge(1.0_wp)
      end associate
      if (.not. allocated(self%start_value)) return
      self%value = self%start_value(self%part)
      if (.not. abs(self%rate) > 0.0_wp .and. abs(self%value) > 0.0_wp) then
         self%direction = sign(1.0_wp, self%value)
      end if
   end subroutine take_part

   !> Reverse within a part.
   subroutine turn_round(self, time)
      class(drive_type), intent(inout) :: self
      !> Time now [s]
      real(wp), intent(in) :: time

      call self%change(time, 0.0_wp, part_acceleration(self))
   end subroutine turn_round

   !> Acceleration in the current part.
   pure function part_acceleration(self) result(acceleration)
      type(drive_type), intent(in) :: self
      real(wp) :: acceleration

      real(wp) :: start

      acceleration = self%end_rate(self%part) - self%start_rate(self%part)
      start = 0.0_wp
      if (self%part > 1) start = self%part_end(self%part - 1)
      if (abs(acceleration) > 0.0_wp) acceleration = acceleration &
         & / (self%part_end(self%part) - start)
   end function part_acceleration

   !> End of the current part [s]; huge for a part without end.
   pure function end_of_part(self) result(time)
      class(drive_type), intent(in) :: self
      real(wp) :: time

      time = self%part_end(self%part)
   end function end_of_part

   !> Time at which the drive changes next [s]: its part ends, or it reverses.
   pure function next_change(self) result(time)
      class(drive_type), intent(in) :: self
      real(wp) :: time

      time = min(self%part_end(self%part), self%turn)
   end function next_change

   !> Whether the current part is the last one.
   pure function is_last_part(self) result(is_last)
      class(drive_type), intent(in) :: self
      logical :: is_last

      is_last = self%part == size(self%part_end)
   end function is_last_part

   !> Whether the stage ends with the current part, which is not the last.
   pure function is_stage_over(self) result(is_over)
      class(drive_type), intent(in) :: self
      logical :: is_over

      is_over = self%stage_of_part(self%part + 1) /= self%stage_of_part(self%part)
   end function is_stage_over

   !> Number of the current stage.
   pure function stage(self) result(number)
      class(drive_type), intent(in) :: self
      integer :: number

      number = self%stage_of_part(self%part)
   end function stage

   !> Begin a stage: its impulse and its extremes start here.
   subroutine begin_stage(self)
      class(drive_type), intent(inout) :: self

      self%extremes = extremes_type()
      self%earlier_impulse = accumulator_type()
   end subroutine begin_stage

   !> Impulse on the slider in the current stage [N s].
   pure function stage_impulse(self) result(impulse)
      class(drive_type), intent(in) :: self
      real(wp) :: impulse

      impulse = self%earlier_impulse%total() + self%impulse%total()
   end function stage_impulse

   !> Set rate and acceleration.
   subroutine change(self, time, rate, acceleration)
      class(drive_type), intent(inout) :: self
      !> Time now [s], rate now, and acceleration from now on
      real(wp), intent(in) :: time, rate, acceleration

      call self%add_work(self%rate * self%impulse%total())
      call self%earlier_impulse%add(self%impulse%total())
      self%impulse = accumulator_type()
      self%value = self%at(time)
      self%time = time
      self%rate = rate
      self%acceleration = acceleration
      self%turn = huge(1.0_wp)
      if (rate * acceleration < 0.0_wp) self%turn = time - rate / acceleration
      if (abs(rate) > 0.0_wp) then
         self%direction = sign(1.0_wp, rate)
      else if (abs(acceleration) > 0.0_wp) then
         self%direction = sign(1.0_wp, acceleration)
      end if
   end subroutine change

   !> Value at a time: displacement from the moving origin [m], or force [N].
   pure function at(self, time) result(value)
      class(drive_type), intent(in) :: self
      !> Time, until the drive changes [s]
      real(wp), intent(in) :: time
      real(wp) :: value

      value = self%value &
         & + (self%rate + 0.5_wp * self%acceleration * (time - self%time)) * (time - self%time)
   end function at

   !> Rate at a time [m/s or N/s].
   pure function rate_at(self, time) result(rate)
      class(drive_type), intent(in) :: self
      !> Time, until the drive changes [s]
      real(wp), intent(in) :: time
      real(wp) :: rate

      rate = self%rate
      if (.not. abs(self%acceleration) > 0.0_wp) return
      rate = rate + self%acceleration * (time - self%time)
      ! Rounding must not reverse it early.
      rate = self%direction * max(0.0_wp, self%direction * rate)
   end function rate_at

   !> Work done so far [J].
   pure function work(self)
      class(drive_type), intent(in) :: self
      real(wp) :: work

      work = self%earlier_work%total() + self%rate * self%impulse%total()
   end function work

   !> Add work that the impulse at constant velocity does not have.
   pure subroutine add_work(self, work)
      class(drive_type), intent(inout) :: self
      !> The work [J]
      real(wp), intent(in) :: work

      call self%earlier_work%add(work)
      self%earlier_gross_work = self%earlier_gross_work + abs(work)
   end subroutine add_work

   !> Sum of the sizes of the parts of the work so far [J]: at each constant velocity, and in each
   !> advance of a drive that accelerates or is a force.
   pure function gross_work(self) result(work)
      class(drive_type), intent(in) :: self
      real(wp) :: work

      work = self%earlier_gross_work + abs(self%rate * self%impulse%total())
   end function gross_work

   !> Move the time and the origin of the value, so that both count from now on.
   subroutine rebase(self, time, shift)
      class(drive_type), intent(inout) :: self
      !> Time now [s], and displacement of the new origin [m]; 0 for a force
      real(wp), intent(in) :: time, shift

      self%value = self%at(time) - shift
      self%rate = self%rate_at(time)
      self%time = time
   end subroutine rebase

   !> Write the state to an archive, or read it.
   subroutine exchange(self, archive)
      class(drive_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%exchange("drive part", self%part)
      call archive%exchange("drive time", self%time)
      call archive%exchange("drive value", self%value)
      call archive%exchange("drive rate", self%rate)
      call archive%exchange("drive acceleration", self%acceleration)
      call archive%exchange("drive turn", self%turn)
      call archive%exchange("drive direction", self%direction)
      call archive%exchange("impulse", self%impulse)
      call archive%exchange("earlier_work", self%earlier_work)
      call archive%exchange("earlier_gross_work", self%earlier_gross_work)
      call archive%exchange("earlier_impulse", self%earlier_impulse)
      call self%extremes%exchange(archive)
   end subroutine exchange

end module mesoslip_drive
