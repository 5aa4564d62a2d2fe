!> The onset of slip, Eqs. S46 and S47, dimensionless: x = K (X - X_c)/F_s, time times Omega_S.
module mesoslip_theory_onset
   use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_int, c_loc, c_ptr
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_parameters, only: name_length
   use mesoslip_numerics_sundials_cvode, only: cvode_type, method_bdf
   implicit none
   private

   public :: onset_type, integrate_onset
   public :: onset_columns, equation_sequential, equation_melting, equation_names

   !> Contacts break one after another, S46
   integer, parameter :: equation_sequential = 1
   !> The whole film melts at once, S47
   integer, parameter :: equation_melting = 2
   !> Names of the equation_ codes
   character(len=*), parameter :: equation_names(2) = [character(len=10) :: "sequential", "melting"]

   !> Columns of the samples; the mean velocity is the running mean
   character(len=*), parameter :: onset_columns(*) = [character(len=name_length) :: "time", &
      & "displacement", "velocity", "mean_velocity"]

   !> An equation of the onset of slip.
   type :: onset_type
      !> One of the equation_ codes
      integer :: equation = equation_sequential
      !> Coefficients D0, D1, D2, D3
      real(wp) :: D(0:3) = 0.0_wp
      !> eta_S/Omega_S, and eta/Omega_S of the molten film
      real(wp) :: damping = 0.0_wp, drag = 0.0_wp
      !> Displacement at which S46 ends, because its expansion does
      real(wp) :: end_displacement = huge(1.0_wp)
   end type onset_type

contains

   !> Integrate an equation until it ends: S46 where its expansion does, S47 at the minimum of the
   !> spring force, where the slider is as slow as the drive again.
   subroutine integrate_onset(onset, interval, tolerance, samples, count, ended, error)
      type(onset_type), intent(in), target :: onset
      !> Interval of the samples, and relative tolerance of the integration
      real(wp), intent(in) :: interval, tolerance
      !> Samples, the last one at the end, shape (numbers in a sample, capacity)
      real(wp), intent(out) :: samples(:, :)
      integer, intent(out) :: count
      !> Whether the end was reached before the last sample
      logical, intent(out) :: ended
      !> Set if the integration fails
      type(error_type), allocatable, intent(out) :: error

      ! Displacements are of order D1 at the start and 1 at the end.
      real(wp), parameter :: least = 1.0e-3_wp
      type(cvode_type) :: cvode
      real(c_double), target :: state(3)
      real(c_double) :: time

      state = [0.0_wp, onset%D(1), onset%D(1)]
      samples = 0.0_wp
      samples(:, 1) = [0.0_wp, state]
      count = 1
      ended = .false.
      call cvode%open(rates, c_loc(onset), method_bdf, 2, 0.0_wp, state, tolerance, &
         & tolerance * onset%D(1) * least, root=distance_to_end, error=error)
      if (allocated(error)) return
      do while (count < size(samples, 2) .and. .not. ended)
         call cvode%integrate(count * interval, time, ended, error)
         if (allocated(error)) return
         count = count + 1
         samples(:, count) = [time, state]
      end do
      call cvode%close()
   end subroutine integrate_onset

   !> Rates of displacement, velocity and running mean of the velocity.
   function rates(time, size, state, rate, data) bind(c, name="mesoslip_onset_rates") &
      & result(status)
      real(c_double), value :: time
      integer(c_int), value :: size
      real(c_double), intent(in) :: state(size)
      real(c_double), intent(inout) :: rate(size)
      type(c_ptr), value :: data
      integer(c_int) :: status

      type(onset_type), pointer :: onset

      call c_f_pointer(data, onset)
      rate(1) = state(2)
      rate(3) = onset%damping * (state(2) - state(3))
      if (onset%equation == equation_sequential) then
         rate(2) = onset%D(1) * time + (onset%D(2) + onset%D(3) * state(1)) * state(1)**2 - rate(3)
      else
         rate(2) = onset%D(0) + onset%D(1) * time - state(1) - onset%drag * state(2) - rate(3)
      end if
      status = 0
   end function rates

   !> Zero at the end of an equation.
   function distance_to_end(time, size, state, data) bind(c, name="mesoslip_onset_end") &
      & result(value)
      real(c_double), value :: time
      integer(c_int), value :: size
      real(c_double), intent(in) :: state(size)
      type(c_ptr), value :: data
      real(c_double) :: value

      type(onset_type), pointer :: onset

      call c_f_pointer(data, onset)
      if (onset%equation == equation_sequential) then
         value = onset%end_displacement - state(1)
      else
         ! At the start the slider is as slow as the drive as well.
         value = state(2) - onset%D(1)
         if (.not. time > 0.0_c_double) value = onset%D(0)
      end if
   end function distance_to_end

end module mesoslip_theory_onset
