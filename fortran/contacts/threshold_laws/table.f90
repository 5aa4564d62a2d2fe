!> Law of a table, such as that of measured contact areas: its density is constant in cells.
!>
!> With stiffnesses the cells are those of break stretches, x_s = f_s/k, and each has one stiffness:
!> in each of them the threshold is k x_s.
module mesoslip_contacts_threshold_laws_table
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_contacts_stretch_cells, only: cell_of, stretch_cells_type
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   implicit none
   private

   public :: table_law_type

   !> Maximum number of cells. Laws have no allocatable components: gfortran 12 frees those of
   !> polymorphic components twice.
   integer, parameter :: max_cells = 4000
   !> Tolerance of the means, which must be 1
   real(wp), parameter :: tolerance = 1.0e-9_wp

   !> Law of a table.
   type, extends(threshold_law_type) :: table_law_type
      !> Edges of the cells, ascending, and the probability to exceed each; the first cells + 1 are
      !> used
      real(wp), private :: edge(max_cells + 1) = 0.0_wp, above(max_cells + 1) = 0.0_wp
      !> Lower end of each cell, with stiffnesses after rejection, and the stiffness in it
      real(wp), private :: low(max_cells) = 0.0_wp, stiffness(max_cells) = 1.0_wp
   contains
      procedure :: take
      procedure :: plain_quantile, plain_density, plain_survival
      procedure :: cell_edges, stretch_cells, stiffness_at, reject_stretches
      procedure, non_overridable, private :: take_stiffnesses
   end type table_law_type

contains

   subroutine take(self, parameters, error)
      class(table_law_type), intent(inout) :: self
      type(parameters_type), intent(inout) :: parameters
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
         self%low(:cells) = edge(:cells)
         weight = weight / sum(weight)
         do cell = cells, 1, -1
            self%above(cell) = self%above(cell + 1) + weight(cell)
         end do
         self%above(:cells) = self%above(:cells) / self%above(1)
         mean = sum(weight * 0.5_wp * (edge(:cells) + edge(2:)))
         square = sum(weight * (edge(:cells)**2 + edge(:cells) * edge(2:) + edge(2:)**2)) / 3.0_wp
      end associate
      self%width = sqrt(max(0.0_wp, square - mean**2))
      if (parameters%has("threshold_stiffnesses")) then
         call self%take_stiffnesses(weight, parameters, error)
         return
      end if
      if (abs(mean - 1.0_wp) > tolerance) then
         call raise(error, status_invalid, "the mean of a table of thresholds must be 1")
      end if
   end subroutine take

   !> Take the stiffness of each cell; the edges are then those of break stretches.
   subroutine take_stiffnesses(self, weight, parameters, error)
      class(table_law_type), intent(inout) :: self
      !> Probability of each cell
      real(wp), intent(in) :: weight(:)
      type(parameters_type), intent(inout) :: parameters
      !> Set if there is not one for each cell, one is not positive, or a mean is not 1
      type(error_type), allocatable, intent(inout) :: error

      real(wp), allocatable :: stiffness(:)
      real(wp) :: mean_threshold

      call parameters%take("threshold_stiffnesses", stiffness, error)
      if (allocated(error)) return
      if (size(stiffness) /= self%cells) then
         call raise(error, status_invalid, "a table of thresholds needs as many stiffnesses as " &
            & // "weights")
         return
      end if
      mean_threshold = 0.5_wp * sum(weight * stiffness &
         & * (self%edge(:self%cells) + self%edge(2:self%cells + 1)))
      if (any(stiffness <= 0.0_wp) .or. abs(sum(weight * stiffness) - 1.0_wp) > tolerance &
         & .or. abs(mean_threshold - 1.0_wp) > tolerance) then
         call raise(error, status_invalid, "stiffnesses of a table of thresholds must be " &
            & // "positive, their mean 1, and that of the thresholds too")
         return
      end if
      self%has_stiffnesses = .true.
      self%stiffness(:self%cells) = stiffness
      self%mean_square_stiffness = sum(weight * stiffness**2)
   end subroutine take_stiffnesses

   pure function stretch_cells(self) result(cells)
      class(table_law_type), intent(in) :: self
      type(stretch_cells_type) :: cells

      allocate (cells%low, source=self%low(:self%cells))
      cells%high = self%edge(2:self%cells + 1)
      cells%share = self%above(:self%cells) - self%above(2:self%cells + 1)
      cells%stiffness = self%stiffness(:self%cells)
   end function stretch_cells

   elemental function stiffness_at(self, stretch) result(stiffness)
      class(table_law_type), intent(in) :: self
      real(wp), intent(in) :: stretch
      real(wp) :: stiffness

      stiffness = self%stiffness(cell_of(self%edge(:self%cells + 1), stretch, 1.0_wp))
   end function stiffness_at

   !> Reject contacts whose threshold is not above a force: the part of each cell below f/k.
   subroutine reject_stretches(self, force, error)
      class(table_law_type), intent(inout) :: self
      real(wp), intent(in) :: force
      type(error_type), allocatable, intent(inout) :: error

      type(stretch_cells_type) :: cells
      integer :: cell

      cells = self%stretch_cells()
      call cells%reject_below(force)
      if (size(cells%share) == 0) then
         call raise(error, status_invalid, "no threshold of the law exceeds the back force")
         return
      end if
      self%cells = size(cells%share)
      self%low(:self%cells) = cells%low
      self%edge(1) = cells%low(1)
      self%edge(2:self%cells + 1) = cells%high
      self%stiffness(:self%cells) = cells%stiffness
      self%above(self%cells + 1) = 0.0_wp
      do cell = self%cells, 1, -1
         self%above(cell) = self%above(cell + 1) + cells%share(cell)
      end do
      self%above(:self%cells) = self%above(:self%cells) / self%above(1)
   end subroutine reject_stretches

   pure function cell_edges(self) result(edge)
      class(table_law_type), intent(in) :: self
      real(wp) :: edge(self%cells + 1)

      edge = self%edge(:self%cells + 1)
   end function cell_edges

   pure real(wp) function plain_quantile(self, argument) result(value)
      class(table_law_type), intent(in) :: self
      real(wp), intent(in) :: argument

      integer :: cell

      ! Probabilities descend as thresholds ascend.
      cell = cell_of(self%above(:self%cells + 1), argument, -1.0_wp)
      associate (low => self%low(cell), high => self%edge(cell + 1), &
         & above => self%above(cell:cell + 1))
         value = low + (high - low) * (above(1) - argument) / (above(1) - above(2))
         value = min(max(value, low), high)
      end associate
   end function plain_quantile

   pure real(wp) function plain_density(self, argument) result(value)
      class(table_law_type), intent(in) :: self
      real(wp), intent(in) :: argument

      integer :: cell

      value = 0.0_wp
      if (argument < self%edge(1) .or. argument > self%edge(self%cells + 1)) return
      cell = cell_of(self%edge(:self%cells + 1), argument, 1.0_wp)
      if (argument < self%low(cell)) return
      value = (self%above(cell) - self%above(cell + 1)) / (self%edge(cell + 1) - self%low(cell))
   end function plain_density

   pure real(wp) function plain_survival(self, argument) result(value)
      class(table_law_type), intent(in) :: self
      real(wp), intent(in) :: argument

      real(wp) :: part
      integer :: cell

      cell = cell_of(self%edge(:self%cells + 1), argument, 1.0_wp)
      part = (self%edge(cell + 1) - argument) / (self%edge(cell + 1) - self%low(cell))
      part = min(1.0_wp, max(0.0_wp, part))
      value = self%above(cell + 1) + part * (self%above(cell) - self%above(cell + 1))
   end function plain_survival

end module mesoslip_contacts_threshold_laws_table
