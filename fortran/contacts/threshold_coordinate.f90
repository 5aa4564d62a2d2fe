!> Coordinates in which the density of a threshold law is smooth: u; its root for laws that reach
!> close to 0, where the density may be singular; its logarithm for logarithmic laws.
module mesoslip_contacts_threshold_coordinate
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: threshold_coordinate_type, new_threshold_coordinate

   !> The coordinates
   integer, parameter :: linear = 1, root = 2, logarithmic = 3
   !> Thresholds below this are close to 0
   real(wp), parameter :: close = 0.1_wp

   !> A coordinate of thresholds.
   type :: threshold_coordinate_type
      integer, private :: kind = linear
   contains
      !> Coordinate of a threshold; threshold at a coordinate, and its derivative
      procedure, non_overridable :: at, threshold, slope
   end type threshold_coordinate_type

contains

   !> The coordinate of a law.
   pure function new_threshold_coordinate(is_logarithmic, min_threshold) result(self)
      !> Whether the density varies with the logarithm of the threshold
      logical, intent(in) :: is_logarithmic
      !> Minimum threshold
      real(wp), intent(in) :: min_threshold
      type(threshold_coordinate_type) :: self

      if (is_logarithmic) then
         self%kind = logarithmic
      else if (min_threshold < close) then
         self%kind = root
      end if
   end function new_threshold_coordinate

   !> Coordinate of a threshold.
   elemental function at(self, threshold) result(coordinate)
      class(threshold_coordinate_type), intent(in) :: self
      !> Relative threshold
      real(wp), intent(in) :: threshold
      real(wp) :: coordinate

      coordinate = threshold
      if (self%kind == root) coordinate = sqrt(threshold)
      if (self%kind == logarithmic) coordinate = log(threshold)
   end function at

   !> Threshold at a coordinate.
   elemental function threshold(self, coordinate)
      class(threshold_coordinate_type), intent(in) :: self
      real(wp), intent(in) :: coordinate
      real(wp) :: threshold

      threshold = coordinate
      if (self%kind == root) threshold = coordinate**2
      if (self%kind == logarithmic) threshold = exp(coordinate)
   end function threshold

   !> Derivative of the threshold with respect to the coordinate.
   elemental function slope(self, coordinate)
      class(threshold_coordinate_type), intent(in) :: self
      real(wp), intent(in) :: coordinate
      real(wp) :: slope

      slope = 1.0_wp
      if (self%kind == root) slope = 2.0_wp * coordinate
      if (self%kind == logarithmic) slope = exp(coordinate)
   end function slope

end module mesoslip_contacts_threshold_coordinate
