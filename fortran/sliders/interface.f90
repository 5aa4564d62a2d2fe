!> A slider with a length: blocks in a row, joined by springs (section 16 of the model).
!>
!> A spring of the drive pulls block 1, or springs pull all blocks from above, or both. Displacement
!> and velocity are means over the blocks. The motion is that of mesoslip_sliders_interface_row.
module mesoslip_sliders_interface
   use mesoslip_interface_law, only: clocks, interface_law_type, window_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_sliders_base, only: exchange_slider, motion_type, shift_law, shift_slider, &
      & slider_type
   use mesoslip_sliders_interface_rest, only: solve_static
   use mesoslip_sliders_interface_row, only: row_slider_type
   implicit none
   private

   public :: slider_interface_type, make_slider_interface

   !> Blocks in a row.
   type, extends(row_slider_type) :: slider_interface_type
   contains
      procedure :: start, advance, observe, observe_layers, pulled_velocity, energy, shift_origin, &
         & exchange
   end type slider_interface_type

contains

   !> Set up a row of blocks from named numbers.
   subroutine make_slider_interface(slider, parameters, error)
      class(slider_type), allocatable, intent(out) :: slider
      type(parameters_type), intent(inout) :: parameters
      type(error_type), allocatable, intent(inout) :: error

      type(slider_interface_type), allocatable :: self

      allocate (self)
      call parameters%take("blocks", self%blocks, error)
      call parameters%take("mass", self%mass, error)
      call parameters%take("neighbour_spring", self%neighbour_spring, error)
      call parameters%take("neighbour_damping", self%neighbour_damping, error)
      call parameters%take("edge_stiffness", self%edge_stiffness, error)
      call parameters%take("top_stiffness", self%top_stiffness, error)
      call parameters%take("damping", self%damping, error)
      call parameters%finish(error)
      if (allocated(error)) return
      if (self%blocks < 1 .or. .not. (self%edge_stiffness + self%top_stiffness > 0.0_wp)) then
         call raise(error, status_invalid, "a row needs a block and a spring to the drive")
         return
      end if
      call self%set_up_row(error)
      if (allocated(error)) return
      self%has_passages = .true.
      self%own_rate = sqrt((self%edge_stiffness + self%top_stiffness) / self%mass)
      call move_alloc(self, slider)
   end subroutine make_slider_interface

   !> Put the blocks, whose laws are set, at rest in balance; their mean displacement is zero.
   subroutine start(self, law)
      class(slider_interface_type), intent(inout) :: self
      type(interface_law_type), intent(in) :: law

      real(wp), dimension(self%blocks) :: loaded, pulled, unused

      call solve_static(self, [0.0_wp, 0.0_wp], loaded, unused)
      call solve_static(self, [1.0_wp, 0.0_wp], pulled, unused)
      self%drive%value = -sum(loaded) / sum(pulled - loaded)
      call solve_static(self, [self%drive%value, 0.0_wp], self%place, self%speed)
      self%speed = 0.0_wp
      self%step_time = self%time
      self%base_time = self%time
      call self%sum_motion(1)
      call self%sum_motion(2)
   end subroutine start

   !> Blocks move one by one: the loop of the row advances them.
   subroutine advance(self, law, window)
      class(slider_interface_type), intent(inout) :: self
      type(interface_law_type), intent(in) :: law
      type(window_type), intent(in) :: window

      call raise(self%failure, status_invalid, "a slider of blocks needs contacts of blocks")
   end subroutine advance

   !> The mean motion at a time of the last step: exact at its ends, where samples are taken, and
   !> between them the polynomial of order 5 through displacements, velocities and accelerations.
   pure function observe(self, time) result(motion)
      class(slider_interface_type), intent(in) :: self
      real(wp), intent(in) :: time
      type(motion_type) :: motion

      real(wp) :: drive, mean(2), pulled(2), part

      drive = self%drive%at(time)
      part = 1.0_wp
      if (self%time > self%step_time) part = (time - self%step_time) / (self%time - self%step_time)
      mean = between(self%mean, part, self%time - self%step_time)
      pulled = between(self%pulled, part, self%time - self%step_time)
      motion%time = time
      motion%drive_displacement = self%origin + drive
      motion%displacement = self%origin + mean(1)
      motion%velocity = mean(2)
      motion%spring_force = (self%edge_stiffness + self%top_stiffness) * (drive - pulled(1))
      motion%elastic_force = motion%spring_force
      motion%contact_force = (1.0_wp - part) * self%total_force(1) + part * self%total_force(2)
      motion%pulled_velocity = pulled(2)
   end function observe

   !> Value and slope between two ends with values, slopes and half the second derivatives.
   pure function between(ends, part, length) result(value)
      real(wp), intent(in) :: ends(3, 2)
      !> Part of the way, and its length
      real(wp), intent(in) :: part, length
      real(wp) :: value(2)

      real(wp) :: from(0:2), gap(0:2), series(0:5)
      integer :: term

      if (part >= 1.0_wp .or. .not. length > 0.0_wp) then
         value = ends(1:2, 2)
         return
      end if
      from = ends(:, 1) * [1.0_wp, length, length**2]
      gap = ends(:, 2) * [1.0_wp, length, length**2]
      ! What the end differs by from the parabola at the start: value, slope, half the bend.
      gap = [gap(0) - sum(from), gap(1) - from(1) - 2.0_wp * from(2), gap(2) - from(2)]
      series(0:2) = from
      series(3) = 10.0_wp * gap(0) - 4.0_wp * gap(1) + gap(2)
      series(4) = -15.0_wp * gap(0) + 7.0_wp * gap(1) - 2.0_wp * gap(2)
      series(5) = 6.0_wp * gap(0) - 3.0_wp * gap(1) + gap(2)
      value = 0.0_wp
      do term = 5, 0, -1
         value(2) = value(2) * part + value(1)
         value(1) = value(1) * part + series(term)
      end do
      value(2) = value(2) / length
   end function between

   !> Velocity of the blocks that springs of the drive pull, by the springs.
   pure function pulled_velocity(self) result(velocity)
      class(slider_interface_type), intent(in) :: self
      real(wp) :: velocity

      velocity = self%pulled(2, 2)
   end function pulled_velocity

   !> Displacements, velocities, contact forces and detached contacts of all blocks, at the end of
   !> the step.
   pure subroutine observe_layers(self, time, displacement)
      class(slider_interface_type), intent(in) :: self
      real(wp), intent(in) :: time
      real(wp), intent(out) :: displacement(:)

      integer :: block, n

      n = self%blocks
      displacement(:n) = self%origin + self%place
      displacement(n + 1:2 * n) = self%speed
      do block = 1, n
         displacement(2 * n + block) = self%block_force(block)
      end do
      displacement(3 * n + 1:) = self%detached
   end subroutine observe_layers

   pure function energy(self)
      class(slider_interface_type), intent(in) :: self
      real(wp) :: energy

      real(wp) :: drive
      integer :: n

      n = self%blocks
      drive = self%drive%at(self%time)
      energy = 0.5_wp * (self%mass / n * sum(self%speed**2) &
         & + self%neighbour_spring * sum((self%place(2:) - self%place(:n - 1))**2) &
         & + self%top_stiffness / n * sum((drive - self%place)**2) &
         & + self%edge_stiffness * (drive - self%place(1))**2)
   end function energy

   subroutine shift_origin(self, shift)
      class(slider_interface_type), intent(inout) :: self
      real(wp), intent(in) :: shift

      integer :: block

      call shift_slider(self, shift)
      self%place = self%place - shift
      self%mean(1, :) = self%mean(1, :) - shift
      self%pulled(1, :) = self%pulled(1, :) - shift
      do block = 1, self%blocks
         call shift_law(self%block(block)%law, shift)
         associate (window => self%block(block)%window)
            if (window%upper < huge(1.0_wp)) window%upper = window%upper - shift
            if (window%lower > -huge(1.0_wp)) window%lower = window%lower - shift
         end associate
      end do
   end subroutine shift_origin

   subroutine exchange(self, archive)
      class(slider_interface_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      integer :: block

      call archive%section("row of blocks")
      call exchange_slider(self, archive)
      call archive%exchange("tiny_displacement", self%tiny_displacement)
      call archive%exchange("pinned_stiffness", self%pinned_stiffness)
      call archive%exchange("max_unknown", self%max_unknown)
      call archive%exchange("pace", self%pace)
      call archive%exchange("event_pace", self%event_pace)
      call archive%exchange("base_time", self%base_time)
      call archive%exchange("is_quiet", self%is_quiet)
      call archive%exchange_fixed("place", [self%blocks, 1], self%place)
      call archive%exchange_fixed("place_remainder", [self%blocks, 1], self%place_remainder)
      call archive%exchange_fixed("speed", [self%blocks, 1], self%speed)
      call archive%exchange_fixed("bend", [self%blocks, 1], self%bend)
      call archive%exchange_fixed("damper", [self%blocks, 1], self%damper)
      call archive%exchange_fixed("sense", [self%blocks, 1], self%sense)
      call archive%exchange_fixed("offer_moment", [self%blocks, 1], self%offer_moment)
      call archive%exchange_fixed("detached", [self%blocks, 1], self%detached)
      call archive%exchange_fixed("mean", [3, 2], self%mean)
      call archive%exchange_fixed("pulled", [3, 2], self%pulled)
      call archive%exchange_fixed("total_force", [2, 1], self%total_force)
      do block = 1, self%blocks
         associate (law => self%block(block)%law, window => self%block(block)%window)
            call archive%exchange("block law stiffness", law%stiffness)
            call archive%exchange("block law offset", law%offset)
            call archive%exchange("block law drag", law%drag)
            call archive%exchange("block law rate", law%rate)
            call archive%exchange("block law tolerance", law%tolerance)
            call archive%exchange("window upper", window%upper)
            call archive%exchange("window lower", window%lower)
            call archive%exchange("window end", window%end_time)
         end associate
      end do
   end subroutine exchange

end module mesoslip_sliders_interface
