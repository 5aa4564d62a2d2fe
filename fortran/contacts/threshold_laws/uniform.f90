!> Uniform law on 1 +- sqrt(3) width.
module mesoslip_contacts_threshold_laws_uniform
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   implicit none
   private

   public :: uniform_law_type

   !> Uniform law on 1 +- sqrt(3) width.
   type, extends(threshold_law_type) :: uniform_law_type
      !> Half the width of the interval
      real(wp), private :: half = 0.0_wp
   contains
      procedure :: set_constants
      procedure :: plain_quantile, plain_density, plain_survival
      procedure :: cell_edges
   end type uniform_law_type

contains

   subroutine set_constants(self)
      class(uniform_law_type), intent(inout) :: self

      self%half = sqrt(3.0_wp) * self%width
      self%cells = 1
   end subroutine set_constants

   pure real(wp) function plain_quantile(self, argument) result(value)
      class(uniform_law_type), intent(in) :: self
      real(wp), intent(in) :: argument

      value = 1.0_wp + self%half * (1.0_wp - 2.0_wp * argument)
   end function plain_quantile

   pure real(wp) function plain_density(self, argument) result(value)
      class(uniform_law_type), intent(in) :: self
      real(wp), intent(in) :: argument

      value = 0.0_wp
      if (abs(argument - 1.0_wp) <= self%half) value = 0.5_wp / self%half
   end function plain_density

   pure real(wp) function plain_survival(self, argument) result(value)
      class(uniform_law_type), intent(in) :: self
      real(wp), intent(in) :: argument

      value = min(1.0_wp, max(0.0_wp, 0.5_wp * (1.0_wp - (argument - 1.0_wp) / self%half)))
   end function plain_survival

   pure function cell_edges(self) result(edge)
      class(uniform_law_type), intent(in) :: self
      real(wp) :: edge(self%cells + 1)

      edge = 1.0_wp + self%half * [-1.0_wp, 1.0_wp]
   end function cell_edges

end module mesoslip_contacts_threshold_laws_uniform
