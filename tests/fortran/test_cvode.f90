!> CVODE is there and right: a damped oscillator against its closed form.
module oscillator
   use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_funloc, c_funptr, c_int, c_ptr
   use mesoslip_numerics_sundials_cvode, only: vector_values
   implicit none
   private

   public :: oscillator_type, right_side, failing_rates

   !> x'' + 2 damping x' + frequency**2 x = 0
   type :: oscillator_type
      !> Both in 1/s
      real(c_double) :: damping = 0.1_c_double, frequency = 2.0_c_double
   end type oscillator_type

contains

   !> Right side of the first-order system, for CVODE.
   function right_side(time, state, rate, user_data) bind(c) result(status)
      real(c_double), value :: time
      type(c_ptr), value :: state, rate, user_data
      integer(c_int) :: status

      type(oscillator_type), pointer :: parameters
      real(c_double), pointer :: y(:), dy(:)

      call c_f_pointer(user_data, parameters)
      y => vector_values(state)
      dy => vector_values(rate)
      dy(1) = y(2)
      dy(2) = -2 * parameters%damping * y(2) - parameters%frequency**2 * y(1)
      status = 0
   end function right_side

   !> A system whose rates cannot be computed.
   function no_rates(time, state, rate, user_data) bind(c) result(status)
      real(c_double), value :: time
      type(c_ptr), value :: state, rate, user_data
      integer(c_int) :: status

      status = -1
   end function no_rates

   !> That function, for CVODE.
   function failing_rates() result(pointer)
      type(c_funptr) :: pointer

      pointer = c_funloc(no_rates)
   end function failing_rates

end module oscillator

program test_cvode
   use, intrinsic :: iso_c_binding, only: c_associated, c_double, c_funloc, c_int, c_loc, c_long, &
      & c_ptr
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_sundials_cvode, only: cvode_type, method_adams, method_bdf, &
      & sundials_version
   use mesoslip_numerics_sundials_index, only: sunindextype
   use mesoslip_numerics_sundials_library, only: CV_ADAMS, CV_NORMAL, CVode, CVodeCreate, &
      & CVodeFree, CVodeGetDky, CVodeInit, CVodeSetMaxNumSteps, CVodeSetNonlinearSolver, &
      & CVodeSetUserData, CVodeSStolerances, N_VDestroy, N_VMake_Serial, SUNContext_Free, &
      & SUNNonlinSol_FixedPoint, SUNNonlinSolFree, create_context
   use oscillator, only: failing_rates, oscillator_type, right_side
   use testing, only: check, check_close, finish
   implicit none

   real(c_double), parameter :: end_time = 20.0_c_double
   type(oscillator_type), target :: parameters
   real(c_double), target :: values(2), middle(2)
   real(c_double) :: time, between
   type(c_ptr) :: context, memory, solver, state, dense

   values = [1.0_c_double, 0.0_c_double]
   call succeed(create_context(context), "context")
   state = N_VMake_Serial(2_sunindextype, c_loc(values), context)
   dense = N_VMake_Serial(2_sunindextype, c_loc(middle), context)
   memory = CVodeCreate(CV_ADAMS, context)
   call check(c_associated(memory), "CVODE is created")
   call succeed(CVodeInit(memory, c_funloc(right_side), 0.0_c_double, state), "problem")
   call succeed(CVodeSetUserData(memory, c_loc(parameters)), "user data")
   call succeed(CVodeSStolerances(memory, 1.0e-11_c_double, 1.0e-12_c_double), "tolerances")
   call succeed(CVodeSetMaxNumSteps(memory, 100000_c_long), "number of steps")
   solver = SUNNonlinSol_FixedPoint(state, 0_c_int, context)
   call succeed(CVodeSetNonlinearSolver(memory, solver), "nonlinear solver")

   time = 0.0_c_double
   call succeed(CVode(memory, end_time, state, time, CV_NORMAL), "integration")
   call check_close(time, end_time, 0.0_wp, "the end is reached")
   call check_close(values(1), exact(end_time), 1.0e-8_wp, "displacement at the end")

   between = end_time - 1.0e-3_c_double
   call succeed(CVodeGetDky(memory, between, 0_c_int, dense), "dense output")
   call check_close(middle(1), exact(between), 1.0e-8_wp, "displacement in between")

   call check(index(sundials_version(), ".") > 1, "SUNDIALS states its version")

   call CVodeFree(memory)
   call succeed(SUNNonlinSolFree(solver), "end of the solver")
   call N_VDestroy(state)
   call N_VDestroy(dense)
   call succeed(SUNContext_Free(context), "end of the context")
   call wrapped(method_adams)
   call wrapped(method_bdf)
   call fails()
   call finish()

contains

   !> The same by our own type: an end, a restart, steps and their polynomials.
   subroutine wrapped(method)
      integer, intent(in) :: method

      type(cvode_type) :: cvode
      type(error_type), allocatable :: error
      real(wp), target :: state(2), between(2)
      real(wp) :: reached, length
      integer :: order
      logical :: has_root

      state = [1.0_wp, 0.0_wp]
      call cvode%open(c_funloc(right_side), c_loc(parameters), method, 1, 0.0_wp, state, &
         & 1.0e-10_wp, 1.0e-12_wp, error)
      call check(.not. allocated(error) .and. cvode%is_open(), "an integrator is open")
      call cvode%integrate(5.0_wp, reached, has_root, error)
      call check_close(state(1), exact(reached), 1.0e-7_wp, "displacement after some time")
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
   end subroutine wrapped

   !> A failure is an error with CVODE's message, and leaves nothing open.
   subroutine fails()
      type(cvode_type) :: cvode
      type(error_type), allocatable :: error
      real(wp), target :: state(2)
      real(wp) :: reached
      logical :: has_root

      state = [1.0_wp, 0.0_wp]
      call cvode%open(failing_rates(), c_loc(parameters), method_adams, 1, 0.0_wp, state, &
         & 1.0e-8_wp, 1.0e-12_wp, error)
      call cvode%integrate(5.0_wp, reached, has_root, error)
      call check(allocated(error) .and. .not. cvode%is_open(), "a failure is an error")
      if (allocated(error)) call check(index(error%message, "right-hand side") > 0, &
         & "CVODE's message: " // error%message)
   end subroutine fails

   !> Check the status that SUNDIALS returned.
   subroutine succeed(status, name)
      !> 0 means success
      integer(c_int), intent(in) :: status
      !> What was done
      character(len=*), intent(in) :: name

      call check(status == 0, "status: " // name)
   end subroutine succeed

   !> Closed form of the displacement.
   pure function exact(at) result(displacement)
      real(wp), intent(in) :: at
      real(wp) :: displacement

      real(wp) :: frequency

      frequency = sqrt(parameters%frequency**2 - parameters%damping**2)
      displacement = exp(-parameters%damping * at) &
         & * (cos(frequency * at) + parameters%damping / frequency * sin(frequency * at))
   end function exact

end program test_cvode
