!> Survival of contacts of all thresholds under thermal activation.
!>
!> A contact of the relative threshold u has the integrated hazard exp((e - u)/theta), where theta
!> is f_T/f_s and the level e is the same for all contacts of a population. It has broken at once
!> if u is not above the maximum b of the force on it. So the number of surviving contacts is
!>
!>     M(b, e) = integral of p(u) exp(-exp((e - u)/theta)) over u > b.
!>
!> With s = (b - e)/theta it depends on s over a distance of about 1, and on b as smoothly as the
!> law. The table is of ln(-ln(M/S)), which is nearly linear in s; S(b) is the number without
!> activation. Where nearly all contacts below e have broken, M does not depend on b: then there is
!> a table of one variable, with as many knots as it needs. Laws whose density is constant in cells
!> have sums of a function of one variable instead of tables.
module mesoslip_contacts_populations_survivors
   use mesoslip_contacts_partial_moments, only: partial_moments_type
   use mesoslip_contacts_threshold_coordinate, only: threshold_coordinate_type
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_quadrature, only: gauss_legendre
   implicit none
   private

   public :: survivors_type, new_survivors, no_level

   !> Level of contacts without a hazard yet
   real(wp), parameter :: no_level = -huge(1.0_wp)

   !> Range of s in the table, knots, and knots of b
   real(wp), parameter :: first_s = -4.0_wp, step_s = 0.1_wp
   integer, parameter :: knots_s = 161, knots_b = 193
   !> Probability that a threshold is above those of the table
   real(wp), parameter :: outside = 1.0e-13_wp
   !> Points of the rule in a panel, panels over the range of the law, length of a panel over theta
   !> where the hazard varies, and maximum number of nodes
   integer, parameter :: points = 8, law_panels = 24, max_nodes = 4096
   real(wp), parameter :: panel = 2.0_wp
   !> Distances over theta below and above e beyond which all contacts and no contacts have broken
   real(wp), parameter :: below = 4.0_wp, above = 34.0_wp
   !> Range of levels in the table of one variable: distances over theta below the lowest threshold
   !> and above the highest
   real(wp), parameter :: early = 12.0_wp, late = 3.5_wp
   !> Error of its interpolation, initial number of cells, maximum halvings of one of them, and
   !> maximum number of knots
   real(wp), parameter :: tolerance = 1.0e-9_wp
   integer, parameter :: first_cells = 48, max_halvings = 30, max_knots = 20000
   !> Knots of the loss by cells, and its range
   integer, parameter :: loss_knots = 1601
   real(wp), parameter :: loss_first = -4.0_wp, loss_step = 0.02_wp
   real(wp), parameter :: euler = 0.57721566490153286061_wp

   !> Points of a quadrature over thresholds, and the number of contacts above the last of them.
   type :: nodes_type
      integer :: count = 0
      real(wp) :: threshold(max_nodes) = 0.0_wp, share(max_nodes) = 0.0_wp, rest = 0.0_wp
   end type nodes_type

   !> Fraction of the contacts of a law that survives activation.
   type :: survivors_type
      !> f_T/f_s
      real(wp), private :: width = 1.0_wp
      !> Lowest and highest threshold in the tables
      real(wp), private :: lowest = 0.0_wp, highest = 1.0_wp
      !> The coordinate of the law, and the length of a panel in it
      type(threshold_coordinate_type), private :: coordinate
      real(wp), private :: law_panel = 1.0_wp
      !> First knot of b and their distance, in the coordinate of the law
      real(wp), private :: first_b = 0.0_wp, step_b = 1.0_wp
      real(wp), private :: point(points) = 0.0_wp, weight(points) = 0.0_wp
      !> Values and, over the distances of knots, slopes in s and b and mixed ones, shape (4,
      !> knots_s, knots_b)
      real(wp), allocatable, private :: table(:, :, :)
      !> Levels, values and slopes of the table of one variable, shape (3, knots)
      real(wp), allocatable, private :: free(:, :)
      !> Of a law with a constant density in cells: edges, densities, and the loss above each knot
      real(wp), allocatable, private :: edge(:), density(:), loss(:)
   contains
      procedure, non_overridable :: left
      procedure, non_overridable, private :: tabulate, tabulate_free, tabulate_loss
      procedure, non_overridable, private :: place_nodes, free_at, free_share, table_share, &
         & cell_share, loss_above
   end type survivors_type

contains

   !> Tabulate the survivors of a law, of which the first partial moment is the number of contacts,
   !> for the width f_T/f_s.
   subroutine new_survivors(self, law, moments, width)
      type(survivors_type), intent(out) :: self
      class(threshold_law_type), intent(in) :: law
      type(partial_moments_type), intent(in) :: moments
      real(wp), intent(in) :: width

      self%width = width
      self%lowest = moments%min_threshold
      self%highest = min(moments%max_threshold, law%quantile(outside))
      if (law%cells > 0) then
         self%edge = moments%edge
         self%density = moments%cell_density
         call self%tabulate_loss()
         return
      end if
      call gauss_legendre(self%point, self%weight)
      self%coordinate = moments%coordinate
      self%first_b = self%coordinate%at(self%lowest)
      self%law_panel = (self%coordinate%at(moments%max_threshold) - self%first_b) / law_panels
      self%step_b = (self%coordinate%at(self%highest) - self%first_b) / (knots_b - 1)
      call self%tabulate(law, moments)
      call self%tabulate_free(law, moments)
   end subroutine new_survivors

   !> Number of contacts above a threshold without activation.
   pure function number_above(moments, threshold) result(number)
      type(partial_moments_type), intent(in) :: moments
      real(wp), intent(in) :: threshold
      real(wp) :: number

      associate (all => moments%above(threshold))
         number = all(1)
      end associate
   end function number_above

   !> Points over a range of thresholds, dense where the hazard varies: around a level and above.
   subroutine place_nodes(self, law, moments, first, last, level, nodes)
      class(survivors_type), intent(in) :: self
      class(threshold_law_type), intent(in) :: law
      type(partial_moments_type), intent(in) :: moments
      real(wp), intent(in) :: first, last, level
      type(nodes_type), intent(inout) :: nodes

      real(wp) :: start, end, place
      integer :: node

      nodes%count = 0
      start = first
      do while (start < last .and. nodes%count + points <= max_nodes)
         end = min(last, self%coordinate%threshold(self%coordinate%at(start) + self%law_panel))
         if (start >= level - below * self%width) then
            end = min(end, start + panel * self%width)
         else
            end = min(end, level - below * self%width)
         end if
         do node = 1, points
            nodes%count = nodes%count + 1
            ! In the coordinate of the law, in which its density is smooth.
            place = self%coordinate%at(start) &
               & + self%point(node) * (self%coordinate%at(end) - self%coordinate%at(start))
            nodes%threshold(nodes%count) = self%coordinate%threshold(place)
            associate (u => nodes%threshold(nodes%count))
               nodes%share(nodes%count) = self%weight(node) * law%density(u) &
                  & * self%coordinate%slope(place) &
                  & * (self%coordinate%at(end) - self%coordinate%at(start))
            end associate
         end do
         start = end
         if (start > level + above * self%width) exit
      end do
      nodes%rest = number_above(moments, start)
   end subroutine place_nodes

   !> Tabulate the survivors over s and b.
   subroutine tabulate(self, law, moments)
      class(survivors_type), intent(inout) :: self
      class(threshold_law_type), intent(in) :: law
      type(partial_moments_type), intent(in) :: moments

      real(wp) :: b, place, slope, density, number, s, w, kept, lost, left, first(2)
      real(wp), allocatable :: scaled(:)
      type(nodes_type) :: nodes
      integer :: knot, one, node

      allocate (self%table(4, knots_s, knots_b), scaled(max_nodes))
      do knot = 1, knots_b
         place = self%first_b + (knot - 1) * self%step_b
         b = self%coordinate%threshold(place)
         if (knot == 1) b = self%lowest
         slope = self%coordinate%slope(place) * self%step_b
         call self%place_nodes(law, moments, b, moments%max_threshold, &
            & b - first_s * self%width, nodes)
         ! The density is not defined at the lowest threshold itself.
         density = law%density(b * (1.0_wp + epsilon(b)) + tiny(b))
         number = number_above(moments, b)
         scaled(:nodes%count) = exp((b - nodes%threshold(:nodes%count)) / self%width)
         do one = 1, knots_s
            s = first_s + (one - 1) * step_s
            lost = 0.0_wp
            left = nodes%rest
            first = 0.0_wp
            do node = 1, nodes%count
               w = exp(-s) * scaled(node)
               kept = exp(-w)
               lost = lost + nodes%share(node) * lost_part(w, kept)
               left = left + nodes%share(node) * kept
               first(1) = first(1) + nodes%share(node) * w * kept
               first(2) = first(2) + nodes%share(node) * w**2 * kept
            end do
            w = exp(-s)
            call slopes(number, density * slope, slope / self%width, w, lost, left, first, &
               & self%table(:, one, knot))
         end do
      end do
   end subroutine tabulate

   !> The logarithm of -ln(M/S), and its slopes at fixed b and at fixed s.
   pure subroutine slopes(number, density, scale, w, lost, left, moment, values)
      !> Number without activation; its density and one over theta, both over the knots of b
      real(wp), intent(in) :: number, density, scale
      !> Hazard at b, number that it breaks, and number that survives
      real(wp), intent(in) :: w, lost, left
      !> Sums of the hazard and of its square over the survivors
      real(wp), intent(in) :: moment(2)
      real(wp), intent(out) :: values(4)

      real(wp) :: hazard, by_s, by_b, by_both, change

      if (lost < 0.5_wp * number) then
         hazard = -log_of_one_plus(-lost / number)
      else
         hazard = log(number / left)
      end if
      by_s = -moment(1) / left
      change = density * (lost / number) - density * (1.0_wp - exp(-w)) + scale * moment(1)
      by_b = change / left
      by_both = (-density * (moment(1) / number) + density * w * exp(-w) &
         & + scale * (moment(2) - moment(1))) / left - by_b * (moment(1) / left)
      values(1) = log(hazard)
      values(2) = step_s * by_s / hazard
      values(3) = by_b / hazard
      values(4) = step_s * (by_both / hazard - (by_s / hazard) * (by_b / hazard))
   end subroutine slopes

   !> ln(1 + x), accurate for small x.
   elemental function log_of_one_plus(x) result(logarithm)
      real(wp), intent(in) :: x
      real(wp) :: logarithm

      real(wp) :: sum

      sum = 1.0_wp + x
      logarithm = x
      if (abs(sum - 1.0_wp) > 0.0_wp) logarithm = log(sum) * (x / (sum - 1.0_wp))
   end function log_of_one_plus

   !> Tabulate survivors that do not depend on b over the level.
   subroutine tabulate_free(self, law, moments)
      class(survivors_type), intent(inout) :: self
      class(threshold_law_type), intent(in) :: law
      type(partial_moments_type), intent(in) :: moments

      real(wp), allocatable :: found(:, :), more(:, :)
      real(wp) :: first, last, to
      integer :: cell, count

      first = self%lowest - early * self%width
      last = self%highest + late * self%width
      allocate (found(3, 256))
      count = 1
      found(:, 1) = self%free_at(law, moments, first)
      do cell = 1, first_cells
         ! Above the lowest threshold in the coordinate of the law, as its density varies.
         to = self%lowest
         if (cell > 1) to = self%coordinate%threshold(self%first_b + (cell - 1) &
            & * (self%coordinate%at(last) - self%first_b) / (first_cells - 1))
         call refine(found(:, count), self%free_at(law, moments, to), max_halvings)
      end do
      self%free = found(:, :count)

   contains

      !> Add the knots of a cell, halved until its interpolation is accurate.
      recursive subroutine refine(start, end, halvings)
         real(wp), intent(in) :: start(3), end(3)
         integer, intent(in) :: halvings

         real(wp) :: middle(3), left(3), length, guess

         left = start
         length = end(1) - left(1)
         if (halvings > 0 .and. count < max_knots) then
            middle = self%free_at(law, moments, left(1) + 0.5_wp * length)
            guess = 0.5_wp * (left(2) + end(2)) + 0.125_wp * length * (left(3) - end(3))
            if (abs(guess - middle(2)) > tolerance * (1.0_wp + exp(min(middle(2), 0.0_wp)))) then
               call refine(left, middle, halvings - 1)
               call refine(middle, end, halvings - 1)
               return
            end if
         end if
         if (count == size(found, 2)) then
            allocate (more(3, 2 * count))
            more(:, :count) = found
            call move_alloc(more, found)
         end if
         count = count + 1
         found(:, count) = end
      end subroutine refine

   end subroutine tabulate_free

   !> A level, the logarithm of -ln(M/S) there, and its slope.
   function free_at(self, law, moments, level) result(values)
      class(survivors_type), intent(in) :: self
      class(threshold_law_type), intent(in) :: law
      type(partial_moments_type), intent(in) :: moments
      real(wp), intent(in) :: level
      real(wp) :: values(3)

      type(nodes_type) :: nodes
      real(wp) :: w, kept, lost, left, slope, hazard
      integer :: node

      call self%place_nodes(law, moments, self%lowest, moments%max_threshold, level, nodes)
      lost = 0.0_wp
      left = nodes%rest
      slope = 0.0_wp
      do node = 1, nodes%count
         w = exp(min(700.0_wp, (level - nodes%threshold(node)) / self%width))
         kept = exp(-w)
         lost = lost + nodes%share(node) * lost_part(w, kept)
         left = left + nodes%share(node) * kept
         slope = slope + nodes%share(node) * w * kept
      end do
      if (lost < 0.5_wp) then
         hazard = -log_of_one_plus(-lost)
      else
         hazard = -log(max(left, tiny(left)))
      end if
      values = [level, log(hazard), slope / self%width / max(left, tiny(left)) / hazard]
   end function free_at

   !> Surviving number of the contacts that activation would leave unbroken, given the threshold up
   !> to which contacts broke at once.
   pure function left(self, broken, level, number)
      class(survivors_type), intent(in) :: self
      real(wp), intent(in) :: broken, level, number
      real(wp) :: left

      left = number
      if (.not. level > no_level .or. .not. number > 0.0_wp) return
      if (allocated(self%edge)) then
         left = self%cell_share(broken, level)
      else if (broken <= self%lowest .or. broken - level < first_s * self%width) then
         left = self%free_share(level)
      else if (broken < self%highest) then
         left = number * self%table_share(broken, level)
      else
         left = 0.0_wp
      end if
      left = min(left, number)
   end function left

   !> Survivors that do not depend on b.
   pure function free_share(self, level) result(share)
      class(survivors_type), intent(in) :: self
      real(wp), intent(in) :: level
      real(wp) :: share

      real(wp) :: value, length, t
      integer :: first, last, middle

      last = size(self%free, 2)
      if (level >= self%free(1, last)) then
         share = 0.0_wp
         return
      end if
      if (level <= self%free(1, 1)) then
         value = self%free(2, 1) + (level - self%free(1, 1)) / self%width
      else
         first = 1
         do while (last - first > 1)
            middle = (first + last) / 2
            if (self%free(1, middle) <= level) then
               first = middle
            else
               last = middle
            end if
         end do
         length = self%free(1, last) - self%free(1, first)
         t = (level - self%free(1, first)) / length
         associate (one => self%free(:, first), two => self%free(:, last))
            value = cubic(one(2), length * one(3), two(2), length * two(3), t)
         end associate
      end if
      share = exp(-exp(value))
   end function free_share

   !> Cubic with given values and slopes at 0 and 1.
   elemental function cubic(value, slope, end_value, end_slope, t)
      real(wp), intent(in) :: value, slope, end_value, end_slope, t
      real(wp) :: cubic

      real(wp) :: s

      s = 1.0_wp - t
      cubic = s**2 * ((1.0_wp + 2.0_wp * t) * value + t * slope) &
         & + t**2 * ((1.0_wp + 2.0_wp * s) * end_value - s * end_slope)
   end function cubic

   !> Survivors above b, by the table.
   pure function table_share(self, broken, level) result(share)
      class(survivors_type), intent(in) :: self
      real(wp), intent(in) :: broken, level
      real(wp) :: share

      real(wp) :: place, t, s, excess, low(2), high(2), value
      integer :: cell, one

      place = (self%coordinate%at(broken) - self%first_b) / self%step_b
      cell = max(0, min(int(place), knots_b - 2))
      t = place - cell
      s = ((broken - level) / self%width - first_s) / step_s
      excess = max(0.0_wp, s - (knots_s - 1))
      s = s - excess
      one = max(0, min(int(s), knots_s - 2))
      associate (corner => self%table(:, one + 1:one + 2, cell + 1:cell + 2))
         low = cubic(corner(1, :, 1), corner(3, :, 1), corner(1, :, 2), corner(3, :, 2), t)
         high = cubic(corner(2, :, 1), corner(4, :, 1), corner(2, :, 2), corner(4, :, 2), t)
      end associate
      value = cubic(low(1), high(1), low(2), high(2), s - one) - excess * step_s
      share = exp(-exp(value))
   end function table_share

   !> Tabulate the integral of 1 - exp(-exp(-z)) above each knot.
   subroutine tabulate_loss(self)
      class(survivors_type), intent(inout) :: self

      real(wp) :: point(points), weight(points), knot
      integer :: cell

      call gauss_legendre(point, weight)
      allocate (self%loss(loss_knots))
      knot = loss_first + (loss_knots - 1) * loss_step
      self%loss(loss_knots) = exp(-knot)
      do cell = loss_knots - 1, 1, -1
         knot = loss_first + (cell - 1) * loss_step
         self%loss(cell) = self%loss(cell + 1) &
            & + loss_step * sum(weight * lost_at(knot + loss_step * point))
      end do
   end subroutine tabulate_loss

   !> Broken part of the contacts whose threshold is z theta above the level.
   elemental function lost_at(z) result(part)
      real(wp), intent(in) :: z
      real(wp) :: part

      part = lost_part(exp(-z), exp(-exp(-z)))
   end function lost_at

   !> Broken part of the contacts with the integrated hazard w, given the part exp(-w) that
   !> survives.
   elemental function lost_part(w, kept) result(part)
      real(wp), intent(in) :: w, kept
      real(wp) :: part

      part = merge(1.0_wp - kept, w * (1.0_wp - 0.5_wp * w * (1.0_wp - w / 3.0_wp)), w > 1.0e-3_wp)
   end function lost_part

   !> Integral of the broken part from z upwards.
   pure function loss_above(self, z) result(loss)
      class(survivors_type), intent(in) :: self
      real(wp), intent(in) :: z
      real(wp) :: loss

      real(wp) :: place, t
      integer :: cell

      place = (z - loss_first) / loss_step
      cell = int(place)
      if (place < 0.0_wp) then
         loss = euler - z
      else if (cell >= loss_knots - 1) then
         loss = exp(-z)
      else
         t = place - cell
         loss = cubic(self%loss(cell + 1), -loss_step * lost_at(loss_first + cell * loss_step), &
            & self%loss(cell + 2), -loss_step * lost_at(loss_first + (cell + 1) * loss_step), t)
      end if
   end function loss_above

   !> Survivors whose thresholds have a constant density in cells.
   pure function cell_share(self, broken, level) result(left)
      class(survivors_type), intent(in) :: self
      real(wp), intent(in) :: broken, level
      real(wp) :: left

      real(wp) :: lower, upper, low, high
      integer :: cell

      left = 0.0_wp
      upper = self%edge(size(self%edge))
      high = self%loss_above((upper - level) / self%width)
      do cell = size(self%density), 1, -1
         if (.not. upper > broken) return
         lower = max(broken, self%edge(cell))
         low = self%loss_above((lower - level) / self%width)
         left = left + self%density(cell) * max(0.0_wp, (upper - lower) - self%width * (low - high))
         upper = lower
         high = low
      end do
   end function cell_share

end module mesoslip_contacts_populations_survivors
