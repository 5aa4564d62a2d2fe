!> CVODE against the closed form of a damped oscillator.
module oscillator
   use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_int, c_ptr
   implicit none
   private

   public :: oscillator_type, right_side, jacobian, displacement, failing_rates

   !> x'' + 2 damping x' + frequency**2 x = 0
   type :: oscillator_type
      !> Both in 1/s
      real(c_double) :: damping = 0.1_c_double, frequency = 2.0_c_double
   end type oscillator_type

contains

   !> Right side of the first-order system.
   function right_side(time, size, state, rate, data) bind(c) result(status)
      real(c_double), value :: time
      integer(c_int), value :: size
      real(c_double), intent(in) :: state(size)
      real(c_double), intent(inout) :: rate(size)
      type(c_ptr), value :: data
      integer(c_int) :: status

      type(oscillator_type), pointer :: parameters

      call c_f_pointer(data, parameters)
      rate(1) = state(2)
      rate(2) = -2 * parameters%damping * state(2) - parameters%frequency**2 * state(1)
      status = 0
   end function right_side

   !> Its Jacobian.
   subroutine jacobian(rows, size, upper, entries, data) bind(c)
      integer(c_int), value :: rows, size, upper
      real(c_double), intent(inout) :: entries(rows, size)
      type(c_ptr), value :: data

      type(oscillator_type), pointer :: parameters

      call c_f_pointer(data, parameters)
      entries = 0.0_c_double
      entries(upper, 2) = 1.0_c_double
      entries(upper + 2, 1) = -parameters%frequency**2
      entries(upper + 1, 2) = -2 * parameters%damping
   end subroutine jacobian

   !> Displacement, to find its zeros.
   function displacement(time, size, state, data) bind(c) result(value)
      real(c_double), value :: time
      integer(c_int), value :: size
      real(c_double), intent(in) :: state(size)
      type(c_ptr), value :: data
      real(c_double) :: value

      value = state(1)
   end function displacement

   !> Rates that cannot be computed.
   function failing_rates(time, size, state, rate, data) bind(c) result(status)
      real(c_double), value :: time
      integer(c_int), value :: size
      real(c_double), intent(in) :: state(size)
      real(c_double), intent(inout) :: rate(size)
      type(c_ptr), value :: data
      integer(c_int) :: status

      status = -1
   end function failing_rates

end module oscillator

program test_cvode
   use, intrinsic :: iso_c_binding, only: c_loc
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_sundials_cvode, only: cvode_type, method_adams, method_bdf, &
      & sundials_version
   use oscillator, only: displacement, failing_rates, jacobian, oscillator_type, right_side
   use testing, only: check, check_close, finish
   implicit none

   type(oscillator_type), target :: parameters

   call check(index(sundials_version(), ".") > 1, "SUNDIALS states its version")
   call integrates(method_adams, with_jacobian=.false.)
   call integrates(method_bdf, with_jacobian=.false.)
   call integrates(method_bdf, with_jacobian=.true.)
   call finds_a_root()
   call fails()
   call finish()

contains

   !> An end, a restart, steps and their polynomials.
   subroutine integrates(method, with_jacobian)
      integer, intent(in) :: method
      logical, intent(in) :: with_jacobian

      type(cvode_type) :: cvode
      type(error_type), allocatable :: error
      real(wp), target :: state(2), between(2)
      real(wp) :: reached, length
      integer :: order
      logical :: has_root

      state = [1.0_wp, 0.0_wp]
      if (with_jacobian) then
         call cvode%open(right_side, c_loc(parameters), method, 1, 0.0_wp, state, 1.0e-10_wp, &
            & 1.0e-12_wp, jacobian=jacobian, error=error)
      else
         call cvode%open(right_side, c_loc(parameters), method, 1, 0.0_wp, state, 1.0e-10_wp, &
            & 1.0e-12_wp, error=error)
      end if
      call check(.not. allocated(error) .and. cvode%is_open(), "an integrator is open")
      call cvode%integrate(5.0_wp, reached, has_root, error)
      call check_close(reached, 5.0_wp, 0.0_wp, "the end is reached")
      call check_close(state(1), exact(5.0_wp), 1.0e-7_wp, "displacement after some time")
      call check(.not. has_root, "no roots are looked for")
      call cvode%restart(5.0_wp, error)
      do
         call cvode%step(6.0_wp, reached, length, order, error)
         if (allocated(error) .or. reached >= 6.0_wp) exit
      end do
      call check(.not. allocated(error), "steps after a restart")
      call check_close(state(1), exact(6.0_wp), 1.0e-7_wp, "displacement after a restart")
      call cvode%derivative(6.0_wp - 0.5_wp * length, 0, between, error)
      call check_close(between(1), exact(6.0_wp - 0.5_wp * length), 1.0e-7_wp, "interpolation")
      call check(all(cvode%counts() >= 0) .and. sum(cvode%counts()) > 10, "steps are counted")
      call cvode%close()
      call check(.not. cvode%is_open(), "an integrator is closed")
   end subroutine integrates

   !> An integration stops at a zero, and continues from there.
   subroutine finds_a_root()
      type(cvode_type) :: cvode
      type(error_type), allocatable :: error
      real(wp), target :: state(2)
      real(wp) :: first, second
      logical :: has_root

      state = [1.0_wp, 0.0_wp]
      call cvode%open(right_side, c_loc(parameters), method_bdf, 1, 0.0_wp, state, 1.0e-10_wp, &
         & 1.0e-12_wp, root=displacement, error=error)
      call cvode%integrate(5.0_wp, first, has_root, error)
      call check(has_root .and. .not. allocated(error), "a root is found")
      call check_close(exact(first), 0.0_wp, 1.0e-7_wp, "displacement at the root")
      call cvode%integrate(5.0_wp, second, has_root, error)
      call check_close(second - first, acos(-1.0_wp) / frequency(), 1.0e-7_wp, "half a period")
      call cvode%close()
   end subroutine finds_a_root

   !> A failure is an error with CVODE's message, and leaves nothing open.
   subroutine fails()
      type(cvode_type) :: cvode
      type(error_type), allocatable :: error
      real(wp), target :: state(2)
      real(wp) :: reached
      logical :: has_root

      state = [1.0_wp, 0.0_wp]
      call cvode%open(failing_rates, c_loc(parameters), method_adams, 1, 0.0_wp, state, &
         & 1.0e-8_wp, 1.0e-12_wp, error=error)
      call cvode%integrate(5.0_wp, reached, has_root, error)
      call check(allocated(error) .and. .not. cvode%is_open(), "a failure is an error")
      if (allocated(error)) call check(index(error%message, "right-hand side") > 0, &
         & "CVODE's message: " // error%message)
   end subroutine fails

   !> Closed form of the displacement.
   pure function exact(at) result(x)
      real(wp), intent(in) :: at
      real(wp) :: x

      x = exp(-parameters%damping * at) * (cos(frequency() * at) &
         & + parameters%damping / frequency() * sin(frequency() * at))
   end function exact

   !> Frequency of the damped oscillation [1/s].
   pure real(wp) function frequency()

      frequency = sqrt(parameters%frequency**2 - parameters%damping**2)
   end function frequency

end program test_cvode
