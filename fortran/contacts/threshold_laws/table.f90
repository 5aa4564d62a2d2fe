!> Law of a table, such as that of measured contact areas: its density is constant in cells.
module mesoslip_contacts_threshold_laws_table
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   implicit none
   private

   public :: table_law_type

   !> Maximum number of cells. Laws have no allocatable components: gfortran 12 frees those of
   !> polymorphic components twice.
   integer, parameter :: max_cells = 4000
   !> Difference of the mean from 1 that counts as none
   real(wp), parameter :: tolerance = 1.0e-9_wp

   !> Law of a table.
   type, extends(threshold_law_type) :: table_law_type
      !> Edges of the cells, ascending, and the probability to exceed each; as many are in use as
      !> there are, cells + 1
      real(wp), private :: edge(max_cells + 1) = 0.0_wp, above(max_cells + 1) = 0.0_wp
   contains
      procedure :: take
      procedure :: plain_quantile
      procedure :: plain_density
      procedure :: plain_survival
      procedure :: cell_edges
   end type table_law_type

contains

   !> Take what the law is made of.
   subroutine take(self, parameters, error)
      !> The law
      class(table_law_type), intent(inout) :: self
      !> Edges of the cells, ascending, and their weights, by name
      type(parameters_type), intent(inout) :: parameters
      !> Set if edges do not ascend, a weight is not positive, or the mean is not 1
      type(error_type), allocatable, intent(inout) :: error

      real(wp), allocatable :: edge(:), weight(:)
      real(wp) :: mean, square
      integer :: cell

      call parameters%take("threshold_edges", edge, error)
      call parameters%take("threshold_weights", weight, error)
      if (allocated(error)) return
      associate (cells => size(weight))
         if (size(edge) /= cells + 1 .or. cells > max_cells) then
            call raise(error, status_invalid, "a table of thresholds needs one edge more than " &
               & // "weights, and at most 4000 of those")
            return
         end if
         if (edge(1) < 0.0_wp .or. any(edge(2:) <= edge(:cells)) .or. any(weight <= 0.0_wp)) then
            call raise(error, status_invalid, "edges of a table of thresholds must ascend from 0 " &
               & // "or above, and weights must be positive")
            return
         end if
         self%cells = cells
         self%edge(:cells + 1) = edge
         weight = weight / sum(weight)
         do cell = cells, 1, -1
            self%above(cell) = self%above(cell + 1) + weight(cell)
         end do
         self%above(:cells) = self%above(:cells) / self%above(1)
         mean = sum(weight * 0.5_wp * (edge(:cells) + edge(2:)))
         square = sum(weight * (edge(:cells)**2 + edge(:cells) * edge(2:) + edge(2:)**2)) / 3.0_wp
      end associate
      if (abs(mean - 1.0_wp) > tolerance) then
         call raise(error, status_invalid, "the mean of a table of thresholds must be 1")
         return
      end if
      self%width = sqrt(max(0.0_wp, square - mean**2))
   end subroutine take

   !> Edges of the cells.
   pure function cell_edges(self) result(edge)
      !> The law
      class(table_law_type), intent(in) :: self
      !> Relative thresholds, ascending, before rejection, shape (cells + 1)
      real(wp) :: edge(self%cells + 1)

      edge = self%edge(:self%cells + 1)
   end function cell_edges

   !> Threshold that is exceeded with a given probability, before rejection.
   pure function plain_quantile(self, argument) result(value)
      !> The law
      class(table_law_type), intent(in) :: self
      !> Probability to exceed the threshold
      real(wp), intent(in) :: argument
      !> Relative threshold
      real(wp) :: value

      integer :: cell

      ! Probabilities descend as thresholds ascend.
      cell = cell_of(self%above(:self%cells + 1), argument, -1.0_wp)
      associate (edge => self%edge(cell:cell + 1), above => self%above(cell:cell + 1))
         value = edge(1) + (edge(2) - edge(1)) * (above(1) - argument) / (above(1) - above(2))
         value = min(max(value, edge(1)), edge(2))
      end associate
   end function plain_quantile

   !> Probability density before rejection.
   pure function plain_density(self, argument) result(value)
      !> The law
      class(table_law_type), intent(in) :: self
      !> Relative threshold
      real(wp), intent(in) :: argument
      !> Probability density
      real(wp) :: value

      integer :: cell

      value = 0.0_wp
      if (argument < self%edge(1) .or. argument > self%edge(self%cells + 1)) return
      cell = cell_of(self%edge(:self%cells + 1), argument, 1.0_wp)
      value = (self%above(cell) - self%above(cell + 1)) / (self%edge(cell + 1) - self%edge(cell))
   end function plain_density

   !> Survival function before rejection.
   pure function plain_survival(self, argument) result(value)
      !> The law
      class(table_law_type), intent(in) :: self
      !> Relative threshold
      real(wp), intent(in) :: argument
      !> Probability to exceed it
      real(wp) :: value

      real(wp) :: part
      integer :: cell

      cell = cell_of(self%edge(:self%cells + 1), argument, 1.0_wp)
      part = (self%edge(cell + 1) - argument) / (self%edge(cell + 1) - self%edge(cell))
      part = min(1.0_wp, max(0.0_wp, part))
      value = self%above(cell + 1) + part * (self%above(cell) - self%above(cell + 1))
   end function plain_survival

   !> The cell that a value lies in, by bisection; the first or the last one beyond the edges.
   pure function cell_of(edge, value, direction) result(cell)
      !> Edges of the cells, shape (cells + 1)
      real(wp), intent(in), contiguous :: edge(:)
      !> The value, and +1 for edges that ascend, -1 for those that descend
      real(wp), intent(in) :: value, direction
      integer :: cell

      integer :: last, middle

      cell = 1
      last = size(edge)
      do while (last - cell > 1)
         middle = (cell + last) / 2
         if (direction * edge(middle) <= direction * value) then
            cell = middle
         else
            last = middle
         end if
      end do
   end function cell_of

end module mesoslip_contacts_threshold_laws_table
