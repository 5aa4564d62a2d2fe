!> A rigid slider on a spring, Eqs. S40 and S41, followed exactly.
!>
!> Under a linear law of the contact force the motion is that of a linear system with constant
!> coefficients. It is advanced by its Taylor series over steps so short that the series is exact to
!> rounding; nothing is a matter of step size. Events are short compared with any period of the
!> system, so a few terms do.
module mesoslip_slider_rigid
   use mesoslip_kinds, only: wp
   use mesoslip_archive, only: archive_type
   use mesoslip_interface_law, only: interface_law_type, window_type
   use mesoslip_slider, only: motion_type, slider_type, exchange_slider
   implicit none
   private

   public :: slider_rigid_type

   !> Terms of the series for short, middling and long steps, and the lengths of these in units of
   !> the fastest rate. What the series leaves out is less than 1e-16 of its two leading terms.
   integer, parameter :: few_terms = 6, some_terms = 10, most_terms = 17
   real(wp), parameter :: short_step = 2.0e-3_wp, middling_step = 8.0e-2_wp, longest_step = 0.5_wp

   integer :: i
   real(wp), parameter :: inverse(most_terms + 1) = [(1.0_wp / i, i=1, most_terms + 1)]

   !> Gauss-Legendre points and weights on [0, 1], for the energy balance of long steps.
   real(wp), parameter :: point(6) = [0.033765242898423986094_wp, 0.16939530676686774317_wp, &
      & 0.38069040695840154568_wp, 0.61930959304159845432_wp, 0.83060469323313225683_wp, &
      & 0.96623475710157601391_wp]
   real(wp), parameter :: weight(6) = [0.085662246189585172520_wp, 0.18038078652406930378_wp, &
      & 0.23395696728634552369_wp, 0.23395696728634552369_wp, 0.18038078652406930378_wp, &
      & 0.085662246189585172520_wp]
   !> Up to this step, in units of the fastest rate, integrals from values and two derivatives at
   !> both ends are exact to rounding: their error is (2 step)**6/100800.
   real(wp), parameter :: step_of_ends = 2.0e-2_wp

   !> The motion at one end of a step, with derivatives.
   type :: derivatives_type
      !> How far the drive is ahead [m], velocity, acceleration and jerk of the slider
      real(wp) :: drive_gap, velocity, acceleration, jerk
      !> eta_S (V - W) [m/s2] and its rate [m/s3]
      real(wp) :: damper, damper_rate
   end type derivatives_type

   !> A rigid slider on a spring.
   type, extends(slider_type) :: slider_rigid_type
      !> Mass M [kg], stiffness of the drive's spring K [N/m], damping rate eta_S [1/s]
      real(wp) :: mass = 1.0_wp, stiffness = 1.0_wp, damping = 0.0_wp
      !> Running mean of the velocity, W [m/s]
      real(wp) :: mean_velocity = 0.0_wp
      !> Contact force during the last advance
      type(interface_law_type), private :: law
      !> Taylor coefficients in (t - step_time)/unit of the displacement [m], the velocity times unit
      !> [m], and eta_S (V - W) times unit**2 [m]
      real(wp), private :: unit = 1.0_wp
      integer, private :: terms = few_terms
      real(wp), private :: way(0:most_terms) = 0.0_wp, pace(0:most_terms) = 0.0_wp
      real(wp), private :: damper(0:most_terms) = 0.0_wp
   contains
      procedure :: start
      procedure :: advance
      procedure :: observe
      procedure :: energy
      procedure :: exchange
   end type slider_rigid_type

contains

   !> Put the slider at rest in balance with the contacts.
   subroutine start(self, law)
      !> The slider, its displacement zero
      class(slider_rigid_type), intent(inout) :: self
      !> Contact force at the start
      type(interface_law_type), intent(in) :: law

      self%law = law
      self%velocity = 0.0_wp
      self%mean_velocity = 0.0_wp
      self%drive_displacement = (law%stiffness * self%displacement - law%offset) / self%stiffness
      self%way = 0.0_wp
      self%pace = 0.0_wp
      self%damper = 0.0_wp
   end subroutine start

   !> Move until the first end of a window, or less far.
   subroutine advance(self, law, window)
      !> The slider
      class(slider_rigid_type), intent(inout) :: self
      !> Contact force
      type(interface_law_type), intent(in) :: law
      !> Where the law holds
      type(window_type), intent(in) :: window

      real(wp) :: inverse_mass, rate, step, gap
      logical :: ends

      self%law = law
      self%step_time = self%time

      inverse_mass = 1.0_wp / self%mass
      rate = sqrt((self%stiffness + law%stiffness) * inverse_mass) + law%drag * inverse_mass &
         & + 2.0_wp * self%damping
      step = window%end_time - self%time
      ends = step * rate <= longest_step
      if (.not. ends) step = longest_step / rate
      ! Most steps end at a break: no need for a series that reaches farther.
      if (self%velocity > 0.0_wp) then
         gap = window%upper - self%displacement
      else
         gap = self%displacement - window%lower
      end if
      if (gap < 0.5_wp * abs(self%velocity) * step) then
         step = 2.0_wp * gap / abs(self%velocity)
         ends = .false.
      end if

      if (.not. step > 0.0_wp) return
      ! The number of terms is a constant in each call, so that the loops over them are unrolled.
      if (rate * step <= short_step) then
         call move(self, window, inverse_mass, rate, step, ends, few_terms)
      else if (rate * step <= middling_step) then
         call move(self, window, inverse_mass, rate, step, ends, some_terms)
      else
         call move(self, window, inverse_mass, rate, step, ends, most_terms)
      end if
   end subroutine advance

   !> Move for a step, or to the first end of the window or turning point within it.
   subroutine move(self, window, inverse_mass, rate, step, ends, terms)
      type(slider_rigid_type), intent(inout) :: self
      type(window_type), intent(in) :: window
      !> One over the mass [1/kg], the fastest rate of the system [1/s], length of the step [s]
      real(wp), intent(in) :: inverse_mass, rate, step
      !> Whether the step comes to the end of the window's time
      logical, intent(in) :: ends
      !> Terms of the series
      integer, intent(in) :: terms

      real(wp) :: fraction, target, drive_gap, reach, inverse_step
      logical :: crosses, turns
      type(derivatives_type) :: early, late
      integer :: term

      drive_gap = self%drive_displacement - self%displacement &
         & + self%drive_velocity * (self%time - self%drive_time)
      call derivatives(self, drive_gap, inverse_mass, early)
      call expand(self, early, inverse_mass, step, terms)

      fraction = 1.0_wp
      crosses = .false.
      turns = .false.
      target = 0.0_wp
      reach = 0.0_wp
      do term = 1, terms
         reach = reach + abs(self%way(term))
      end do
      if (.not. reach < min(window%upper - self%displacement, &
         & self%displacement - window%lower)) then
         call first_end(self, window, terms, fraction, crosses, turns, target)
      end if

      inverse_step = 1.0_wp / step
      self%mean_velocity = self%mean_velocity &
         & + integral(self%damper, terms - 1, fraction) * inverse_step
      self%velocity = horner(self%pace, terms - 1, fraction) * inverse_step
      if (turns) self%velocity = 0.0_wp
      if (crosses) then
         self%displacement = target
      else
         self%displacement = self%displacement + rise(self%way, terms, fraction)
      end if
      if (ends .and. fraction >= 1.0_wp .and. .not. (crosses .or. turns)) then
         self%time = window%end_time
      else
         self%time = self%time + fraction * step
      end if
      drive_gap = self%drive_displacement - self%displacement &
         & + self%drive_velocity * (self%time - self%drive_time)
      call derivatives(self, drive_gap, inverse_mass, late)
      self%acceleration = late%acceleration
      if (abs(self%velocity) > 0.0_wp) self%sense = sign(1.0_wp, self%velocity)
      call add_losses(self, early, late, rate, fraction)
   end subroutine move

   !> Derivatives of the motion, from its equation.
   pure subroutine derivatives(self, drive_gap, inverse_mass, motion)
      type(slider_rigid_type), intent(in) :: self
      real(wp), intent(in) :: drive_gap, inverse_mass
      type(derivatives_type), intent(out) :: motion

      motion%drive_gap = drive_gap
      motion%velocity = self%velocity
      motion%damper = self%damping * (self%velocity - self%mean_velocity)
      motion%acceleration = inverse_mass * (self%stiffness * drive_gap - (self%law%stiffness &
         & * self%displacement - self%law%offset) - self%law%drag * self%velocity) - motion%damper
      motion%damper_rate = self%damping * (motion%acceleration - motion%damper)
      motion%jerk = inverse_mass * (self%stiffness * (self%drive_velocity - self%velocity) &
         & - self%law%stiffness * self%velocity - self%law%drag * motion%acceleration) &
         & - motion%damper_rate
   end subroutine derivatives

   !> Taylor coefficients of the motion.
   pure subroutine expand(self, early, inverse_mass, step, terms)
      type(slider_rigid_type), intent(inout) :: self
      !> The motion at the start of the step
      type(derivatives_type), intent(in) :: early
      !> One over the slider's mass [1/kg], length of the step [s]
      real(wp), intent(in) :: inverse_mass, step
      integer, intent(in) :: terms

      real(wp) :: stiffness, drag, rate, driving
      integer :: term

      stiffness = (self%stiffness + self%law%stiffness) * inverse_mass * step**2
      drag = self%law%drag * inverse_mass * step
      rate = self%damping * step
      driving = self%stiffness * self%drive_velocity * inverse_mass * step**3

      self%unit = step
      self%terms = terms
      self%way(0) = self%displacement
      self%pace(0) = early%velocity * step
      self%way(1) = self%pace(0)
      self%pace(1) = early%acceleration * step**2
      self%way(2) = 0.5_wp * self%pace(1)
      self%damper(0) = early%damper * step**2
      do term = 1, terms - 2
         self%damper(term) = (rate * inverse(term)) * (term * self%pace(term) - self%damper(term - 1))
         self%pace(term + 1) = ((driving - stiffness * self%pace(term - 1)) * inverse(term) &
            & - drag * self%pace(term) - self%damper(term)) * inverse(term + 1)
         self%way(term + 2) = self%pace(term + 1) * inverse(term + 2)
         driving = 0.0_wp
      end do
      self%damper(terms - 1) = (rate * inverse(terms - 1)) &
         & * ((terms - 1) * self%pace(terms - 1) - self%damper(terms - 2))
   end subroutine expand

   !> Shorten a step to the first place where the motion leaves the window or turns round.
   subroutine first_end(self, window, terms, fraction, crosses, turns, target)
      type(slider_rigid_type), intent(in) :: self
      type(window_type), intent(in) :: window
      integer, intent(in) :: terms
      !> Part of the step that is made
      real(wp), intent(inout) :: fraction
      !> Whether it ends at a displacement of the window, and which
      logical, intent(out) :: crosses
      real(wp), intent(out) :: target
      !> Whether it ends at a turning point
      logical, intent(out) :: turns

      integer, parameter :: most_halvings = 100
      real(wp) :: end_pace, sense, rate(0:most_terms)
      integer :: halving, term

      turns = .false.
      sense = sign(1.0_wp, self%way(1))
      if (.not. leads(self%pace, terms - 1, fraction)) then
         do term = 0, terms - 2
            rate(term) = (term + 1) * self%pace(term + 1)
         end do
         do halving = 1, most_halvings
            if (leads(rate, terms - 2, fraction)) then
               ! The acceleration keeps its sign, so there is at most one turning point.
               end_pace = horner(self%pace, terms - 1, fraction)
               if (self%pace(0) * end_pace < 0.0_wp) then
                  fraction = arrival(self%pace, rate, terms - 1, -self%pace(0), fraction)
                  turns = .true.
               else
                  sense = sign(1.0_wp, self%pace(0) + end_pace)
               end if
               exit
            end if
            ! At rest and in balance the jerk decides.
            if (abs(self%pace(0)) + abs(self%pace(1)) <= 0.0_wp) then
               sense = sign(1.0_wp, self%pace(2))
               if (leads(rate(1:), terms - 3, fraction)) exit
            end if
            fraction = 0.5_wp * fraction
            if (leads(self%pace, terms - 1, fraction)) exit
         end do
      end if

      target = merge(window%upper, window%lower, sense > 0.0_wp)
      crosses = sense * (rise(self%way, terms, fraction) - (target - self%displacement)) &
         & >= 0.0_wp
      if (crosses) then
         fraction = arrival(self%way, self%pace, terms, target - self%displacement, fraction)
         turns = .false.
      end if
   end subroutine first_end

   !> Whether a series keeps the sign of its constant term, by the size of the terms after it.
   pure function leads(series, terms, fraction)
      real(wp), intent(in) :: series(0:), fraction
      integer, intent(in) :: terms
      logical :: leads

      real(wp) :: rest
      integer :: term

      rest = 0.0_wp
      do term = terms, 1, -1
         rest = (rest + abs(series(term))) * fraction
      end do
      leads = abs(series(0)) > rest
   end function leads

   !> Where a monotone series has risen by a given amount, by Halley's method within a bracket.
   pure function arrival(series, slope, terms, amount, farthest) result(place)
      !> Coefficients of the series and of its derivative
      real(wp), intent(in) :: series(0:), slope(0:)
      integer, intent(in) :: terms
      !> Amount, reached at the farthest place or before
      real(wp), intent(in) :: amount, farthest
      real(wp) :: place

      integer, parameter :: most_iterations = 100
      real(wp), parameter :: converged = 1.0e-5_wp
      real(wp) :: lower, upper, excess, discriminant, rate, next
      integer :: iteration

      lower = 0.0_wp
      upper = farthest
      place = farthest
      discriminant = series(1)**2 + 4.0_wp * series(2) * amount
      if (discriminant > 0.0_wp) then
         place = min(2.0_wp * amount / (series(1) + sign(sqrt(discriminant), amount)), farthest)
      end if
      do iteration = 1, most_iterations
         excess = rise(series, terms, place) - amount
         if (excess * amount >= 0.0_wp) then
            upper = place
         else
            lower = place
         end if
         rate = horner(slope, terms - 1, place)
         next = lower
         if (abs(excess) < abs(rate) * (upper - lower)) then
            next = excess / rate
            next = place - next * (1.0_wp + next * (0.5_wp * slope(1) + slope(2) * place) / rate)
         end if
         if (next > lower .and. next < upper) then
            ! Convergence is cubic: the next change would be lost in rounding.
            if (abs(next - place) <= converged * next) then
               place = next
               exit
            end if
            place = next
         else
            if (upper - lower <= spacing(upper) .or. abs(excess) <= 0.0_wp) exit
            place = 0.5_wp * (lower + upper)
         end if
      end do
   end function arrival

   !> Add the work and the losses of a step to the energy balance: the integrals of K (X_d - X) v_d,
   !> C V**2 and M eta_S (V - W) V.
   subroutine add_losses(self, early, late, rate, fraction)
      type(slider_rigid_type), intent(inout) :: self
      !> The motion at both ends
      type(derivatives_type), intent(in) :: early, late
      !> Fastest rate of the system [1/s]
      real(wp), intent(in) :: rate
      !> Part of the step that was made
      real(wp), intent(in) :: fraction

      real(wp) :: step, extension, square, damped, pace, drive
      integer :: node

      step = fraction * self%unit
      if (step * rate < step_of_ends) then
         extension = between(step, early%drive_gap, late%drive_gap, &
            & self%drive_velocity - early%velocity, self%drive_velocity - late%velocity, &
            & -early%acceleration, -late%acceleration)
         square = between(step, early%velocity**2, late%velocity**2, &
            & 2.0_wp * early%velocity * early%acceleration, &
            & 2.0_wp * late%velocity * late%acceleration, &
            & 2.0_wp * (early%acceleration**2 + early%velocity * early%jerk), &
            & 2.0_wp * (late%acceleration**2 + late%velocity * late%jerk))
         damped = between(step, early%damper * early%velocity, late%damper * late%velocity, &
            & damped_rate(early), damped_rate(late), &
            & damped_curvature(self%damping, early), damped_curvature(self%damping, late))
      else
         drive = self%drive_velocity * step
         extension = step * (early%drive_gap + 0.5_wp * drive) &
            & - self%unit * (integral(self%way, self%terms, fraction) - fraction * self%way(0))
         square = 0.0_wp
         damped = 0.0_wp
         do node = 1, size(point)
            pace = horner(self%pace, self%terms - 1, point(node) * fraction)
            square = square + weight(node) * pace**2
            damped = damped + weight(node) * pace &
               & * horner(self%damper, self%terms - 1, point(node) * fraction)
         end do
         square = square * fraction / self%unit
         damped = damped * fraction / self%unit**2
      end if
      call self%drive_work%add(self%stiffness * self%drive_velocity * extension)
      call self%drag_loss%add(self%law%drag * square)
      call self%damping_loss%add(self%mass * damped)
   end subroutine add_losses

   !> Integral of a function over a step from its values and derivatives at both ends.
   pure function between(step, early, late, early_rate, late_rate, early_curvature, &
      & late_curvature) result(value)
      real(wp), intent(in) :: step, early, late, early_rate, late_rate
      real(wp), intent(in) :: early_curvature, late_curvature
      real(wp) :: value

      value = step * (0.5_wp * (early + late) + step * (0.1_wp * (early_rate - late_rate) &
         & + step * (early_curvature + late_curvature) / 120.0_wp))
   end function between

   !> Rate of eta_S (V - W) V.
   pure function damped_rate(motion) result(rate)
      type(derivatives_type), intent(in) :: motion
      real(wp) :: rate

      rate = motion%damper_rate * motion%velocity + motion%damper * motion%acceleration
   end function damped_rate

   !> Second derivative of eta_S (V - W) V.
   pure function damped_curvature(damping, motion) result(curvature)
      real(wp), intent(in) :: damping
      type(derivatives_type), intent(in) :: motion
      real(wp) :: curvature

      curvature = damping * (motion%jerk - motion%damper_rate) * motion%velocity &
         & + 2.0_wp * motion%damper_rate * motion%acceleration + motion%damper * motion%jerk
   end function damped_curvature

   !> The motion at a time of the last advance.
   pure function observe(self, time) result(motion)
      !> The slider
      class(slider_rigid_type), intent(in) :: self
      !> Time [s]
      real(wp), intent(in) :: time
      !> The motion
      type(motion_type) :: motion

      real(wp) :: displacement, drive, fraction
      integer :: term

      fraction = (time - self%step_time) / self%unit
      drive = self%drive_at(time)
      displacement = self%way(0) + rise(self%way, self%terms, fraction)
      motion%time = time
      motion%drive_displacement = self%origin + drive
      motion%displacement = self%origin + displacement
      motion%velocity = horner(self%pace, self%terms - 1, fraction) / self%unit
      motion%acceleration = 0.0_wp
      do term = self%terms - 1, 1, -1
         motion%acceleration = motion%acceleration * fraction + term * self%pace(term)
      end do
      motion%acceleration = motion%acceleration / self%unit**2
      motion%spring_force = self%stiffness * (drive - displacement)
      motion%contact_force = self%law%stiffness * displacement - self%law%offset &
         & + self%law%drag * motion%velocity
   end function observe

   !> Kinetic energy and that of the drive's spring.
   pure function energy(self)
      !> The slider
      class(slider_rigid_type), intent(in) :: self
      !> Energy [J]
      real(wp) :: energy

      energy = 0.5_wp * self%mass * self%velocity**2 &
         & + 0.5_wp * self%stiffness * (self%drive_at(self%time) - self%displacement)**2
   end function energy

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      !> The slider
      class(slider_rigid_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call exchange_slider(self, archive)
      call archive%exchange(self%mean_velocity)
   end subroutine exchange

   !> Value of a series.
   pure function horner(series, terms, place) result(value)
      real(wp), intent(in) :: series(0:), place
      integer, intent(in) :: terms
      real(wp) :: value

      integer :: term

      value = series(terms)
      do term = terms - 1, 0, -1
         value = value * place + series(term)
      end do
   end function horner

   !> Value of a series without its constant term.
   pure function rise(series, terms, place) result(value)
      real(wp), intent(in) :: series(0:), place
      integer, intent(in) :: terms
      real(wp) :: value

      integer :: term

      value = 0.0_wp
      do term = terms, 1, -1
         value = (value + series(term)) * place
      end do
   end function rise

   !> Integral of a series from zero.
   pure function integral(series, terms, place) result(value)
      real(wp), intent(in) :: series(0:), place
      integer, intent(in) :: terms
      real(wp) :: value

      integer :: term

      value = 0.0_wp
      do term = terms, 0, -1
         value = (value + series(term) * inverse(term + 1)) * place
      end do
   end function integral

end module mesoslip_slider_rigid
