!> Thermally activated breaks in a uniform motion.
!>
!> At the constant velocity v the hazard of a contact under positive force grows from the stretch a
!> to the stretch x by omega_0 f_T/(k v) exp(-f_s/f_T) (exp(k x/f_T) - exp(k a/f_T)). The stretch at
!> which it reaches an exponential deviate has a closed form: the contact breaks there or at its
!> threshold, as one without temperature. Under negative force the same holds for the stretch of the
!> other sign. A deviate is drawn at attaching, and for each pinned contact as the motion begins:
!> the process has no memory, so that nothing is left when the motion ends.
module mesoslip_contacts_thermal_uniform
   use mesoslip_contacts_individual_record, only: row_renewal
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_random, only: uniform_pairs
   implicit none
   private

   public :: uniform_motion_type, new_uniform_motion

   !> Minimum velocity, over f_T/k times omega_0: the displacement of a slower slider does not
   !> resolve the time to rounding
   real(wp), parameter :: min_velocity_ratio = 1.0e-6_wp
   !> Numbers of attempt in the keys of the draws: at attaching, and as a motion begins
   integer(i8), parameter :: newborn_attempt = 1_i8, pinned_attempt = 2_i8

   !> Where contacts break in a uniform motion.
   type :: uniform_motion_type
      private
      !> Its velocity [m/s]; 0 while the motion is another
      real(wp) :: velocity = 0.0_wp
      !> Rate at the threshold, omega_0 [1/s], and k/f_T [1/m]
      real(wp) :: rate = 0.0_wp, slope = 0.0_wp
      !> Key of the random numbers, and motions so far
      integer(i8) :: seed = 0, realization = 0, motions = 0
      !> Stretch at which each pinned contact breaks ahead [m], shape (contacts)
      real(wp), allocatable, public :: stretch(:)
      !> Stretch at the threshold of a contact whose next life was solved last [m], shape (contacts)
      real(wp), allocatable, public :: limit(:)
   contains
      !> Follow the motion of the slider, and whether it is uniform
      procedure, non_overridable :: follow, is_used
      !> Solve where contacts break: those that are pinned now, or in their next lives
      procedure, non_overridable :: solve_pinned, solve_newborn
      procedure, non_overridable :: exchange
      procedure, non_overridable, private :: solve, breaking_stretch
   end type uniform_motion_type

contains

   !> Set up without contacts.
   subroutine new_uniform_motion(self, contacts, rate, slope, seed, realization, error)
      type(uniform_motion_type), intent(out) :: self
      !> Number of contacts
      integer, intent(in) :: contacts
      !> Rate at the threshold [1/s], and k/f_T [1/m]
      real(wp), intent(in) :: rate, slope
      !> Key of the random numbers
      integer(i8), intent(in) :: seed, realization
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      integer :: stat

      self%rate = rate
      self%slope = slope
      self%seed = seed
      self%realization = realization
      allocate (self%stretch(contacts), source=0.0_wp, stat=stat)
      if (stat == 0) allocate (self%limit(contacts), source=0.0_wp, stat=stat)
      if (stat /= 0) call raise(error, status_memory, "not enough memory for breaking stretches")
   end subroutine new_uniform_motion

   !> Follow the motion of the slider.
   pure subroutine follow(self, pose, is_new)
      class(uniform_motion_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Whether another motion begins
      logical, intent(out) :: is_new

      real(wp) :: velocity

      velocity = 0.0_wp
      if (pose%is_uniform) velocity = pose%velocity
      if (self%slope * abs(velocity) < min_velocity_ratio * self%rate) velocity = 0.0_wp
      is_new = abs(velocity - self%velocity) > 0.0_wp
      if (.not. is_new) return
      self%velocity = velocity
      self%motions = self%motions + 1_i8
   end subroutine follow

   !> Whether the motion is uniform.
   pure function is_used(self)
      class(uniform_motion_type), intent(in) :: self
      logical :: is_used

      is_used = abs(self%velocity) > 0.0_wp
   end function is_used

   !> Solve where a pinned contact breaks as the motion begins.
   subroutine solve_pinned(self, contact, stretch, limit)
      class(uniform_motion_type), intent(inout) :: self
      integer, intent(in) :: contact
      !> Its stretch along the motion, and that at its threshold [m]
      real(wp), intent(in) :: stretch, limit

      real(wp) :: breaking(1)

      breaking = limit
      call self%solve([contact], [self%motions], pinned_attempt, [stretch], breaking)
      self%stretch(contact) = breaking(1)
   end subroutine solve_pinned

   !> Solve where contacts break that attach in the motion.
   subroutine solve_newborn(self, contact, record, later, stretch, limit)
      class(uniform_motion_type), intent(inout) :: self
      integer, intent(in) :: contact(:)
      !> Records of all contacts, shape (record_length, number of contacts)
      real(wp), intent(in), contiguous :: record(:, :)
      !> Renewals until those lives: 1 for pinned contacts
      integer(i8), intent(in) :: later
      !> First stretches along the motion, and those at the threshold; on return those at which they
      !> break [m]
      real(wp), intent(in) :: stretch(:)
      real(wp), intent(inout) :: limit(:)

      integer(i8) :: renewal(size(contact))
      integer :: event

      do event = 1, size(contact)
         renewal(event) = int(record(row_renewal, contact(event)), i8) + later
         self%limit(contact(event)) = limit(event)
      end do
      call self%solve(contact, renewal, newborn_attempt, stretch, limit)
   end subroutine solve_newborn

   !> Solve where contacts break, by deviates with a key.
   pure subroutine solve(self, contact, number, attempt, stretch, limit)
      class(uniform_motion_type), intent(in) :: self
      integer, intent(in) :: contact(:)
      !> Numbers in the keys of the draws
      integer(i8), intent(in) :: number(:), attempt
      !> Present stretches along the motion, and those at the threshold; on return those at which
      !> they break [m]
      real(wp), intent(in) :: stretch(:)
      real(wp), intent(inout) :: limit(:)

      real(wp), dimension(size(contact)) :: first, second
      integer :: event

      call uniform_pairs(self%seed, self%realization, int(contact - 1, i8), number, attempt, &
         & first, second)
      do event = 1, size(contact)
         limit(event) = self%breaking_stretch(limit(event), stretch(event), -log(first(event)))
      end do
   end subroutine solve

   !> Stretch at which a contact breaks by a deviate, or at its threshold, given the stretch there
   !> and the present one along the motion [m].
   pure function breaking_stretch(self, limit, stretch, deviate) result(breaking)
      class(uniform_motion_type), intent(in) :: self
      real(wp), intent(in) :: limit, stretch, deviate
      real(wp) :: breaking

      real(wp) :: hazard

      ! From zero force on, in units of omega_0 f_T/(k v).
      hazard = deviate * (self%slope * abs(self%velocity) / self%rate)
      if (stretch >= 0.0_wp) then
         hazard = exp(self%slope * (stretch - limit)) + hazard
         breaking = min(limit, limit + log(max(hazard, tiny(1.0_wp))) / self%slope)
         return
      end if
      associate (least => exp(-self%slope * limit))
         hazard = hazard + least - exp(-self%slope * (stretch + limit))
         breaking = min(limit, sign(limit + log(max(abs(hazard) + least, tiny(1.0_wp))) &
            & / self%slope, hazard))
      end associate
   end function breaking_stretch

   !> Write the state to an archive, or read it.
   subroutine exchange(self, archive)
      class(uniform_motion_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%exchange("uniform_velocity", self%velocity)
      call archive%exchange("motions", self%motions)
      call archive%exchange("breaking_stretch", self%stretch)
   end subroutine exchange

end module mesoslip_contacts_thermal_uniform
