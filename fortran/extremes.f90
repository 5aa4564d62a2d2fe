!> Maximum and minimum of a force.
module mesoslip_extremes
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: extremes_type

   !> Maximum and minimum of a force, with their times and displacements.
   type :: extremes_type
      !> The forces [N]
      real(wp) :: max_force = -huge(1.0_wp), min_force = huge(1.0_wp)
      !> Their times [s]
      real(wp) :: max_time = 0.0_wp, min_time = 0.0_wp
      !> Total displacements of the slider then [m]
      real(wp) :: max_displacement = 0.0_wp, min_displacement = 0.0_wp
   contains
      !> Take a force into account
      procedure, non_overridable :: note
      !> Write the state to an archive, or read it
      procedure, non_overridable :: exchange
   end type extremes_type

contains

   !> Take a force into account; of equal ones the first is kept.
   pure subroutine note(self, force, time, displacement)
      class(extremes_type), intent(inout) :: self
      !> Force [N], its time [s], displacement of the slider then [m]
      real(wp), intent(in) :: force, time, displacement

      if (force > self%max_force) then
         self%max_force = force
         self%max_time = time
         self%max_displacement = displacement
      end if
      if (force < self%min_force) then
         self%min_force = force
         self%min_time = time
         self%min_displacement = displacement
      end if
   end subroutine note

   !> Write the state to an archive, or read it.
   subroutine exchange(self, archive)
      class(extremes_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%exchange("max_force", self%max_force)
      call archive%exchange("min_force", self%min_force)
      call archive%exchange("max_time", self%max_time)
      call archive%exchange("min_time", self%min_time)
      call archive%exchange("max_displacement", self%max_displacement)
      call archive%exchange("min_displacement", self%min_displacement)
   end subroutine exchange

end module mesoslip_extremes
