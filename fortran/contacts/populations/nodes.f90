!> Survival of contacts whose thresholds change with age under thermal activation, by threshold.
!>
!> A contact of the configured threshold u has the threshold a + b u at an age, with a and b of its
!> population. Its integrated hazard is a sum of exp((f - a - b u)/theta) over the life: with b
!> constant it would be exp((e - b u)/theta) with one level e of the population, but as b changes,
!> the ratio of the hazards of two thresholds changes too. So a population keeps the surviving part
!> of its contacts at the nodes of Gauss-Legendre rules in panels over the thresholds. Panels are so
!> short that both the law and the hazard are smooth in them. Where contacts up to a threshold have
!> broken, the remainder of its panel is integrated by the polynomial through the nodes.
module mesoslip_contacts_populations_nodes
   use mesoslip_contacts_ageing_law, only: ageing_law_type
   use mesoslip_contacts_partial_moments, only: partial_moments_type
   use mesoslip_contacts_populations_activation, only: activation_type, growth_type
   use mesoslip_contacts_threshold_coordinate, only: threshold_coordinate_type
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_quadrature, only: gauss_legendre
   implicit none
   private

   public :: threshold_nodes_type, new_threshold_nodes

   !> Nodes of a panel
   integer, parameter :: points = 8
   !> Minimum number of panels over the range of the law, maximum length of a panel over theta
   !> divided by the factor b of old contacts, and age of these over that of ageing
   integer, parameter :: law_panels = 10
   real(wp), parameter :: panel_length = 2.0_wp, old_age = 1.0e4_wp
   !> Probability that a threshold is outside of the panels, on either side
   real(wp), parameter :: outside = 1.0e-13_wp
   !> Logarithms of a negligible hazard, and of one that breaks all contacts
   real(wp), parameter :: no_hazard = -32.0_wp, max_exponent = 5.0_wp
   !> Changes of thresholds in a step over theta: up to which they are those at one time, up to
   !> which the rule is short, and in each part of a larger change; maximum number of parts, and
   !> nodes of the rules
   real(wp), parameter :: max_change = 0.1_wp, change_of_part = 1.5_wp, small_change = 0.5_wp
   integer, parameter :: max_parts = 40, times = 4, short_times = 2

   !> Points over the thresholds, the same for all populations.
   type :: threshold_nodes_type
      !> Number of nodes
      integer :: count = 0
      !> f_T/f_s, and one over it
      real(wp), private :: width = 1.0_wp, inverse_width = 1.0_wp
      !> How thresholds age, and a configured threshold for which changes are resolved
      type(ageing_law_type), private :: ageing
      real(wp), private :: typical = 1.0_wp
      !> Edges of the panels, in the coordinate of the law
      type(threshold_coordinate_type), private :: coordinate
      real(wp), allocatable, private :: edge(:)
      !> Thresholds of the nodes, density times length of the panel, shares of contacts, and sums of
      !> shares from each panel on
      real(wp), allocatable, private :: threshold(:), density(:), share(:), shares_from(:)
      !> Legendre's polynomials at the nodes of a panel with the weights of its rule
      real(wp), private :: basis(points, points) = 0.0_wp
      !> Nodes and weights over the time of a part of a step, and of the short rule
      real(wp), private :: time(times) = 0.0_wp, weight(times) = 0.0_wp
      real(wp), private :: short_time(short_times) = 0.0_wp, short_weight(short_times) = 0.0_wp
   contains
      procedure, non_overridable :: left, pass, pass_newborn
      procedure, non_overridable, private :: place_panels, panel_of, break_some, pass_ages
   end type threshold_nodes_type

contains

   !> Place nodes over the configured thresholds of a law, for the width f_T/f_s.
   subroutine new_threshold_nodes(self, law, moments, ageing, width)
      type(threshold_nodes_type), intent(out) :: self
      class(threshold_law_type), intent(in) :: law
      type(partial_moments_type), intent(in) :: moments
      type(ageing_law_type), intent(in) :: ageing
      real(wp), intent(in) :: width

      real(wp) :: point(points), weight(points), place, length, x
      integer :: panel, node, degree

      self%width = width
      self%inverse_width = 1.0_wp / width
      self%ageing = ageing
      self%typical = 1.0_wp + 2.0_wp * law%width
      self%coordinate = moments%coordinate
      call gauss_legendre(point, weight)
      call gauss_legendre(self%time, self%weight)
      call gauss_legendre(self%short_time, self%short_weight)
      do node = 1, points
         x = 2.0_wp * point(node) - 1.0_wp
         do degree = 1, points
            self%basis(node, degree) = weight(node) * legendre(degree - 1, x)
         end do
      end do
      call self%place_panels(law, moments)
      self%count = points * (size(self%edge) - 1)
      allocate (self%threshold(self%count), self%density(self%count), self%share(self%count))
      allocate (self%shares_from(size(self%edge)), source=0.0_wp)
      do panel = size(self%edge) - 1, 1, -1
         length = self%edge(panel + 1) - self%edge(panel)
         self%shares_from(panel) = self%shares_from(panel + 1)
         do node = 1, points
            place = self%edge(panel) + point(node) * length
            associate (one => (panel - 1) * points + node)
               self%threshold(one) = self%coordinate%threshold(place)
               self%density(one) = law%density(self%threshold(one)) &
                  & * self%coordinate%slope(place) * length
               self%share(one) = weight(node) * self%density(one)
               self%shares_from(panel) = self%shares_from(panel) + self%share(one)
            end associate
         end do
      end do
   end subroutine new_threshold_nodes

   !> Place the edges of panels.
   subroutine place_panels(self, law, moments)
      class(threshold_nodes_type), intent(inout) :: self
      class(threshold_law_type), intent(in) :: law
      type(partial_moments_type), intent(in) :: moments

      real(wp), allocatable :: cell(:)
      real(wp) :: max_length, first, last, growth
      integer :: one, part, parts

      growth = max(1.0_wp, self%ageing%threshold(1.0_wp, 1.0_wp, old_age * self%ageing%time))
      max_length = panel_length * self%width / growth
      if (law%cells > 0) then
         cell = moments%edge
      else
         first = self%coordinate%at(moments%min_threshold)
         last = self%coordinate%at(min(moments%max_threshold, law%quantile(outside)))
         cell = [(self%coordinate%threshold(first + one * ((last - first) / law_panels)), &
            & one=0, law_panels)]
      end if
      self%edge = [self%coordinate%at(cell(1))]
      do one = 1, size(cell) - 1
         parts = max(1, ceiling((cell(one + 1) - cell(one)) / max_length))
         self%edge = [self%edge, (self%coordinate%at(cell(one) &
            & + part * ((cell(one + 1) - cell(one)) / parts)), part=1, parts)]
      end do
   end subroutine place_panels

   !> Legendre's polynomial of a degree.
   pure function legendre(degree, x) result(value)
      integer, intent(in) :: degree
      real(wp), intent(in) :: x
      real(wp) :: value

      real(wp) :: before, next
      integer :: one

      value = 1.0_wp
      before = 0.0_wp
      do one = 1, degree
         next = ((2 * one - 1) * x * value - (one - 1) * before) / one
         before = value
         value = next
      end do
   end function legendre

   !> Panel of a threshold in the coordinate of the law, the first or last one if it is outside.
   pure function panel_of(self, place) result(panel)
      class(threshold_nodes_type), intent(in) :: self
      real(wp), intent(in) :: place
      integer :: panel

      integer :: last, middle

      panel = 1
      last = size(self%edge)
      do while (last - panel > 1)
         middle = (panel + last) / 2
         if (self%edge(middle) <= place) then
            panel = middle
         else
            last = middle
         end if
      end do
   end function panel_of

   !> Surviving number of the contacts that activation would leave unbroken, given the configured
   !> threshold up to which contacts broke at once, and the surviving part at each node.
   pure function left(self, broken, kept, number)
      class(threshold_nodes_type), intent(in) :: self
      real(wp), intent(in) :: broken, number
      real(wp), intent(in), contiguous :: kept(:)
      real(wp) :: left

      real(wp) :: place, x, part(points), value(0:points), all, some
      integer :: panel, first, degree

      left = 0.0_wp
      if (.not. number > 0.0_wp) return
      panel = 1
      x = -1.0_wp
      if (broken > self%threshold(1)) then
         place = self%coordinate%at(broken)
         panel = self%panel_of(place)
         x = 2.0_wp * (place - self%edge(panel)) / (self%edge(panel + 1) - self%edge(panel)) &
            & - 1.0_wp
         if (.not. x < 1.0_wp) return
         x = max(x, -1.0_wp)
      end if
      ! Integrals of the polynomials through the nodes from there to the end of the panel.
      value(0) = 1.0_wp
      value(1) = x
      do degree = 1, points - 1
         value(degree + 1) = ((2 * degree + 1) * x * value(degree) - degree * value(degree - 1)) &
            & / (degree + 1)
      end do
      part = self%basis(:, 1) * (0.5_wp * (1.0_wp - x))
      do degree = 1, points - 1
         part = part + self%basis(:, degree + 1) &
            & * (0.5_wp * (value(degree - 1) - value(degree + 1)))
      end do
      first = (panel - 1) * points
      part = part * self%density(first + 1:first + points)
      all = sum(part) + self%shares_from(panel + 1)
      some = sum(part * kept(first + 1:first + points)) &
         & + dot_product(self%share(first + points + 1:), kept(first + points + 1:))
      if (all > 0.0_wp) left = number * max(0.0_wp, min(1.0_wp, some / all))
   end function left

   !> Surviving part at each node after a motion of the slider.
   subroutine pass(self, activation, growth, before, after, birth, force, broken, kept)
      class(threshold_nodes_type), intent(in) :: self
      type(activation_type), intent(in) :: activation
      !> Increase of levels in the motion
      type(growth_type), intent(in) :: growth
      type(pose_type), intent(in) :: before, after
      !> Time of attaching [s], forces before and after, and configured threshold up to which
      !> contacts have broken
      real(wp), intent(in) :: birth, force(2), broken
      real(wp), intent(inout), contiguous :: kept(:)

      real(wp) :: ages(2), age, mean(2), factor(2), change

      if (.not. after%time > before%time) return
      ages = max(0.0_wp, [before%time, after%time] - birth)
      call line_at(self%ageing, ages(1), mean(1), factor(1))
      call line_at(self%ageing, ages(2), mean(2), factor(2))
      change = (abs(mean(2) - mean(1)) + self%typical * abs(factor(2) - factor(1))) &
         & * self%inverse_width
      if (change > max_change) then
         call self%pass_ages(activation%rate, ages, force, change, broken, kept)
      else
         ! With the thresholds at the mean time of the hazard.
         age = ages(1) + growth%mean_time(force(1), force(2)) * (ages(2) - ages(1))
         call line_at(self%ageing, age, mean(1), factor(1))
         call self%break_some([(activation%added(growth, force(1), force(2)) - mean(1)) &
            & * self%inverse_width], [factor(1) * self%inverse_width], broken, kept)
      end if
   end subroutine pass

   !> Surviving part at each node a time [s] after attaching, under a force.
   subroutine pass_newborn(self, rate, duration, force, kept)
      class(threshold_nodes_type), intent(in) :: self
      !> Rate of breaking at the threshold [1/s]
      real(wp), intent(in) :: rate, duration, force
      real(wp), intent(out), contiguous :: kept(:)

      real(wp) :: mean(2), factor(2)

      kept = 1.0_wp
      if (.not. rate * duration > 0.0_wp) return
      call line_at(self%ageing, 0.0_wp, mean(1), factor(1))
      call line_at(self%ageing, duration, mean(2), factor(2))
      call self%pass_ages(rate, [0.0_wp, duration], [force, force], (abs(mean(2) - mean(1)) &
         & + self%typical * abs(factor(2) - factor(1))) * self%inverse_width, 0.0_wp, kept)
   end subroutine pass_newborn

   !> a and b of the thresholds a + b u at an age.
   pure subroutine line_at(ageing, age, mean, factor)
      type(ageing_law_type), intent(in) :: ageing
      real(wp), intent(in) :: age
      real(wp), intent(out) :: mean, factor

      mean = ageing%threshold(0.0_wp, 1.0_wp, age)
      factor = ageing%threshold(1.0_wp, 1.0_wp, age) - mean
   end subroutine line_at

   !> Let contacts break while their thresholds change: a rule over the logarithm of the age, under
   !> a force that changes evenly in time. The change is that of thresholds over theta.
   subroutine pass_ages(self, rate, ages, force, change, broken, kept)
      class(threshold_nodes_type), intent(in) :: self
      real(wp), intent(in) :: rate, ages(2), force(2), change, broken
      real(wp), intent(inout), contiguous :: kept(:)

      real(wp) :: constant(max_parts * times), slope(max_parts * times), logarithm(2), length, more
      integer :: parts, part, node, count

      logarithm = log(ages + self%ageing%time)
      length = logarithm(2) - logarithm(1)
      more = max(length, change + abs(force(2) - force(1)) * self%inverse_width)
      count = 0
      if (more < small_change) then
         do node = 1, short_times
            call add(self%short_time(node) * length, self%short_weight(node) * length)
         end do
      else
         parts = max(1, min(max_parts, ceiling(more / change_of_part)))
         length = length / parts
         do part = 1, parts
            do node = 1, times
               call add((part - 1 + self%time(node)) * length, self%weight(node) * length)
            end do
         end do
      end if
      call self%break_some(constant(:count), slope(:count), broken, kept)

   contains

      !> Add the hazard around an age, given its logarithm minus that before, and its weight.
      subroutine add(place, weight)
         real(wp), intent(in) :: place, weight

         real(wp) :: age, f, a, b

         age = exp(logarithm(1) + place) - self%ageing%time
         age = min(max(age, ages(1)), ages(2))
         f = abs(force(1) + (force(2) - force(1)) * (age - ages(1)) / (ages(2) - ages(1)))
         call line_at(self%ageing, age, a, b)
         count = count + 1
         slope(count) = b * self%inverse_width
         constant(count) = (f - a) * self%inverse_width &
            & + log(rate * weight * (age + self%ageing%time))
      end subroutine add

   end subroutine pass_ages

   !> Let contacts break by their hazards, sums of exp(constant - slope u).
   pure subroutine break_some(self, constant, slope, broken, kept)
      class(threshold_nodes_type), intent(in) :: self
      real(wp), intent(in), contiguous :: constant(:), slope(:)
      real(wp), intent(in) :: broken
      real(wp), intent(inout), contiguous :: kept(:)

      real(wp) :: hazard(self%count), end
      integer :: first, last, one

      first = 1
      if (broken > self%threshold(1)) then
         first = (self%panel_of(self%coordinate%at(broken)) - 1) * points + 1
      end if
      ! The hazard decreases with the threshold.
      end = maxval((constant - no_hazard) / slope)
      if (.not. end > self%threshold(first)) return
      last = points * self%panel_of(self%coordinate%at(end))
      hazard(first:last) = exp(min(constant(1) - slope(1) * self%threshold(first:last), &
         & max_exponent))
      do one = 2, size(constant)
         hazard(first:last) = hazard(first:last) + exp(min(constant(one) &
            & - slope(one) * self%threshold(first:last), max_exponent))
      end do
      kept(first:last) = kept(first:last) * exp(-hazard(first:last))
   end subroutine break_some

end module mesoslip_contacts_populations_nodes
