!> The greatest and the least force so far, with when and where they were.
module mesoslip_extremes
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: extremes_type

   !> Greatest and least of a force since it was last emptied.
   type :: extremes_type
      !> The forces [N]
      real(wp) :: greatest = -huge(1.0_wp), least = huge(1.0_wp)
      !> Their times [s]
      real(wp) :: greatest_time = 0.0_wp, least_time = 0.0_wp
      !> Displacement of the slider then, in all [m]
      real(wp) :: greatest_displacement = 0.0_wp, least_displacement = 0.0_wp
   contains
      !> Take a force into account
      procedure, non_overridable :: note
      !> Put the state into an archive or take it out
      procedure, non_overridable :: exchange
   end type extremes_type

contains

   !> Take a force into account; of equal ones the first stays.
   pure subroutine note(self, force, time, displacement)
      !> The extremes
      class(extremes_type), intent(inout) :: self
      !> Force [N], its time [s], displacement of the slider then [m]
      real(wp), intent(in) :: force, time, displacement

      if (force > self%greatest) then
         self%greatest = force
         self%greatest_time = time
         self%greatest_displacement = displacement
      end if
      if (force < self%least) then
         self%least = force
         self%least_time = time
         self%least_displacement = displacement
      end if
   end subroutine note

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      !> The extremes
      class(extremes_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call archive%exchange("greatest", self%greatest)
      call archive%exchange("least", self%least)
      call archive%exchange("greatest_time", self%greatest_time)
      call archive%exchange("least_time", self%least_time)
      call archive%exchange("greatest_displacement", self%greatest_displacement)
      call archive%exchange("least_displacement", self%least_displacement)
   end subroutine exchange

end module mesoslip_extremes
