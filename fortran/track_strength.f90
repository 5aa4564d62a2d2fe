!> Strength along the track of the slider: contacts that attach at the displacement X have their
!> thresholds times max(floor, 1 + w g(X)) (model section 18).
!>
!> g is stationary and Gaussian, with mean 0 and variance 1. It depends on the key of the random
!> numbers and on X alone, so that the slider meets the same strength each time. It is interpolated
!> within blocks of the correlation length l, at whose edges it is keyed by the number of the block:
!>
!> - Correlation `gaussian`, exp(-(dX/l)**2/2): white noise at points l/2 apart, convolved with
!>   exp(-(dX/l)**2), the square root of the correlation as a convolution. Its variance is constant
!>   to 1e-8.
!> - Correlation `exponential`, exp(-abs(dX)/l): a Markov process, exact at the edges of blocks and,
!>   by the laws of bridges between them, at all points of a block.
!>
!> Between points l/64 or l/256 apart it is linear, scaled so that the variance stays 1; that
!> changes the correlation by less than 1e-3.
module mesoslip_track_strength
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_numerics_random, only: philox_words, uniform_pair
   implicit none
   private

   public :: track_strength_type, take_track_strength

   integer, parameter :: correlation_gaussian = 1, correlation_exponential = 2
   !> Names of the correlations
   character(len=*), parameter :: correlation_names(2) = [character(len=11) :: "gaussian", &
      & "exponential"]
   !> Cells of a block for each correlation
   integer, parameter :: block_cells(2) = [64, 256], max_cells = 256

   !> Number in place of that of a contact in the keys of the draws: no contact has it
   integer(i8), parameter :: stream = 2_i8**32 - 1_i8
   !> Numbers of blocks in keys are not negative, and below the maximum of a key
   integer(i8), parameter :: first_number = 2_i8**46, key_size = 2_i8**48
   !> Maximum size of the number of a block
   real(wp), parameter :: max_block = 2.0_wp**45
   !> First attempt of words in keys, after those of pairs
   integer(i8), parameter :: first_words = 32_i8

   !> Pairs of points of the noise on each side of a block; beyond, its weight is below 2e-9
   integer, parameter :: side = 5
   !> Values before the edge of a block that matter to rounding
   integer, parameter :: memory = 19
   !> Cells of a bridge below which its steps are drawn from a triangular law, not a normal one
   integer, parameter :: fine_cells = 8

   real(wp), parameter :: pi = acos(-1.0_wp)

   !> Strength along a track.
   type :: track_strength_type
      !> Whether strength varies
      logical :: is_used = .false.
      !> Displacement of the origin of displacements [m]
      real(wp) :: origin = 0.0_wp
      !> Spread w, correlation length l [m] and one over it, and minimum factor of thresholds
      real(wp), private :: spread = 0.0_wp, length = 1.0_wp, per_length = 1.0_wp, floor = 0.0_wp
      integer, private :: correlation = correlation_gaussian
      !> Cells of a block
      integer, private :: cells = max_cells
      !> Key of the random numbers
      integer(i8), private :: seed = 0_i8, realization = 0_i8
      !> Number of the present block, and g at the ends of its cells
      integer(i8), private :: block = huge(1_i8)
      real(wp), private :: value(0:max_cells) = 0.0_wp
      !> 1 minus the correlation of the ends of a cell
      real(wp), private :: missing = 0.0_wp
   contains
      !> Factor of the thresholds at a displacement, and g there
      procedure, non_overridable :: factor, relative_strength
      !> Set the stretches of a contact that attaches. It can be overridden, although nothing does
      !> so, as the call by the class keeps this rare case out of the innermost loops of sliders.
      procedure :: lets_attach
      !> Usual maximum of the factor
      procedure, non_overridable :: usual_max
      !> Correlation length [m]
      procedure, non_overridable :: correlation_length
      procedure, non_overridable, private :: fill_gaussian, fill_exponential, normal_pair
   end type track_strength_type

contains

   !> Take the strength along a track from named parameters; there may be none.
   subroutine take_track_strength(self, parameters, seed, realization, error)
      type(track_strength_type), intent(out) :: self
      type(parameters_type), intent(inout) :: parameters
      !> Key of the random numbers
      integer(i8), intent(in) :: seed, realization
      !> Set if a parameter is missing or wrong
      type(error_type), allocatable, intent(inout) :: error

      real(wp) :: cell

      if (.not. parameters%has("track_spread")) return
      self%is_used = .true.
      self%seed = seed
      self%realization = realization
      call parameters%take("track_spread", self%spread, error)
      call parameters%take("track_length", self%length, error)
      call parameters%take("track_floor", self%floor, error)
      call parameters%take("track_correlation", correlation_names, self%correlation, error)
      if (allocated(error)) return
      if (.not. (self%spread >= 0.0_wp .and. self%length > 0.0_wp .and. self%floor > 0.0_wp)) then
         call raise(error, status_invalid, "length and floor of the strength along a track must " &
            & // "be positive, and its spread not negative")
         return
      end if
      self%per_length = 1.0_wp / self%length
      self%cells = block_cells(self%correlation)
      cell = 1.0_wp / self%cells
      if (self%correlation == correlation_gaussian) then
         self%missing = 1.0_wp - exp(-0.5_wp * cell**2)
      else
         self%missing = 1.0_wp - exp(-cell)
      end if
   end subroutine take_track_strength

   !> Factor of the thresholds of contacts that attach where the slider is.
   function factor(self, displacement)
      class(track_strength_type), intent(inout) :: self
      !> Displacement of the slider from the present origin [m]
      real(wp), intent(in) :: displacement
      real(wp) :: factor

      factor = max(self%floor, 1.0_wp + self%spread * self%relative_strength(displacement))
   end function factor

   !> Set the stretches of a contact that attaches by the strength there; false if the contact is
   !> too weak there to attach, and has to be drawn again.
   function lets_attach(self, displacement, scales_stretch, limit, stretch) result(attaches)
      class(track_strength_type), intent(inout) :: self
      !> Displacement of the slider from the present origin [m]
      real(wp), intent(in) :: displacement
      !> Whether the strength multiplies the first stretch too
      logical, intent(in) :: scales_stretch
      !> Stretch at breaking and at first [m], which do not change if it does not attach
      real(wp), intent(inout) :: limit, stretch
      logical :: attaches

      real(wp) :: factor, first

      factor = self%factor(displacement)
      first = stretch
      if (scales_stretch) first = factor * stretch
      attaches = abs(first) < factor * limit
      if (.not. attaches) return
      limit = factor * limit
      stretch = first
   end function lets_attach

   !> The Gaussian function g at a displacement.
   function relative_strength(self, displacement) result(strength)
      class(track_strength_type), intent(inout) :: self
      !> Displacement of the slider from the present origin [m]
      real(wp), intent(in) :: displacement
      real(wp) :: strength

      real(wp) :: place, part
      integer(i8) :: block
      integer :: cell

      ! The start is in the middle of a block.
      place = (self%origin + displacement) * self%per_length + 0.5_wp
      place = max(-max_block, min(max_block, place))
      block = floor(place, i8)
      if (block /= self%block) then
         self%block = block
         if (self%correlation == correlation_gaussian) then
            call self%fill_gaussian()
         else
            call self%fill_exponential()
         end if
      end if
      place = (place - real(block, wp)) * self%cells
      cell = min(int(place), self%cells - 1)
      part = place - cell
      strength = self%value(cell) + part * (self%value(cell + 1) - self%value(cell))
      strength = strength * (1.0_wp + part * (1.0_wp - part) * self%missing)
   end function relative_strength

   !> Usual maximum of the factor: it is higher in some hundredth of the track.
   pure function usual_max(self) result(factor)
      class(track_strength_type), intent(in) :: self
      real(wp) :: factor

      factor = 1.0_wp
      if (self%is_used) factor = 1.0_wp + 2.0_wp * self%spread
   end function usual_max

   !> Correlation length [m].
   pure function correlation_length(self) result(length)
      class(track_strength_type), intent(in) :: self
      real(wp) :: length

      length = self%length
   end function correlation_length

   !> Values in a block with the correlation `gaussian`.
   !>
   !> In units of l from the middle of the block, the noise at j/2 has the weight
   !> exp(-(t - j/2)**2) = exp(-t**2) exp(-(j/2)**2) exp(t)**j: a polynomial in exp(t).
   subroutine fill_gaussian(self)
      class(track_strength_type), intent(inout) :: self

      integer, parameter :: cells = block_cells(correlation_gaussian)
      ! The integral of exp(-2 t**2) over t, times two points a length, is (2 pi)**(1/2).
      real(wp), parameter :: scale = (2.0_wp * pi)**(-0.25_wp)
      real(wp) :: noise(-2 * side:2 * side + 1), t(0:cells), growth(0:cells), total(0:cells)
      integer :: pair, point

      do pair = -side, side
         noise(2 * pair:2 * pair + 1) = self%normal_pair(self%block + pair, 0_i8)
      end do
      do point = -2 * side, 2 * side
         noise(point) = noise(point) * exp(-0.25_wp * point**2)
      end do
      do point = 0, cells
         t(point) = real(point, wp) / cells - 0.5_wp
      end do
      growth = exp(t)
      total = 0.0_wp
      do point = 2 * side, -2 * side, -1
         total = total * growth + noise(point)
      end do
      self%value(:cells) = scale * exp(-t**2 - 2 * side * t) * total
   end subroutine fill_gaussian

   !> Values in a block with the correlation `exponential`.
   !>
   !> At the edges, the values are sums over normal deviates there and at all edges before, which is
   !> a Markov process that can be entered anywhere. In the middle between two points of distance
   !> 2 d, with r = exp(-d/l), the process has the mean r/(1 + r**2) times the sum of their values
   !> and the variance (1 - r**2)/(1 + r**2).
   subroutine fill_exponential(self)
      class(track_strength_type), intent(inout) :: self

      integer, parameter :: cells = block_cells(correlation_exponential)
      real(wp) :: deviate(cells), edge(-memory:1), pair(2), r, mean, width
      integer :: number, span, place

      do number = -memory, 1
         pair = self%normal_pair(self%block + number, 0_i8)
         edge(number) = sqrt(1.0_wp - exp(-2.0_wp)) * pair(1)
      end do
      self%value(0) = decaying_sum(edge(-memory:0))
      self%value(cells) = decaying_sum(edge(-memory + 1:1))
      call draw_deviates()
      span = cells
      do while (span > 1)
         r = exp(-0.5_wp * span / cells)
         mean = r / (1.0_wp + r**2)
         width = sqrt((1.0_wp - r**2) / (1.0_wp + r**2))
         do place = span / 2, cells, span
            self%value(place) = mean * (self%value(place - span / 2) &
               & + self%value(place + span / 2)) + width * deviate(place)
         end do
         span = span / 2
      end do

   contains

      !> Deviates of variance 1 for the points in the block.
      subroutine draw_deviates()
         real(wp) :: normal(2)
         integer(i8) :: word(4)
         integer :: draw, coarse, one

         coarse = cells / fine_cells
         do draw = 1, coarse / 2
            normal = self%normal_pair(self%block, int(draw, i8))
            deviate((2 * draw - 1) * fine_cells) = normal(1)
            deviate(2 * draw * fine_cells) = normal(2)
         end do
         draw = 0
         do one = 1, cells - 1
            if (mod(one, fine_cells) == 0) cycle
            if (mod(draw, 4) == 0) call philox_words(self%seed, self%realization, stream, &
               & number_of(self%block), first_words + draw / 4, word)
            deviate(one) = triangular(word(mod(draw, 4) + 1))
            draw = draw + 1
         end do
      end subroutine draw_deviates

   end subroutine fill_exponential

   !> Sum of numbers of which each has decayed by exp(-1) until the next.
   pure function decaying_sum(number) result(total)
      real(wp), intent(in) :: number(:)
      real(wp) :: total

      integer :: one

      total = 0.0_wp
      do one = 1, size(number)
         total = exp(-1.0_wp) * total + number(one)
      end do
   end function decaying_sum

   !> Deviate of a triangular law with variance 1 from a random 32-bit word: a sum of two uniform
   !> ones.
   elemental function triangular(word) result(deviate)
      integer(i8), intent(in) :: word
      real(wp) :: deviate

      deviate = sqrt(6.0_wp) * (real(iand(word, 65535_i8) + ishft(word, -16) + 1_i8, wp) &
         & / 65536.0_wp - 1.0_wp)
   end function triangular

   !> Key of a block.
   elemental function number_of(block) result(number)
      integer(i8), intent(in) :: block
      integer(i8) :: number

      number = modulo(block + first_number, key_size)
   end function number_of

   !> Two normal deviates of a block (G. Box and M. Muller, Ann. Math. Statist. 29 (1958) 610).
   pure function normal_pair(self, block, attempt) result(normal)
      class(track_strength_type), intent(in) :: self
      integer(i8), intent(in) :: block, attempt
      real(wp) :: normal(2)

      real(wp) :: uniform(2)

      call uniform_pair(self%seed, self%realization, stream, number_of(block), attempt, uniform)
      normal = sqrt(-2.0_wp * log(uniform(1))) * [cos(2.0_wp * pi * uniform(2)), &
         & sin(2.0_wp * pi * uniform(2))]
   end function normal_pair

end module mesoslip_track_strength
