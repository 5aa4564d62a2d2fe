!> A run continues from a saved state to the bit, and other states are refused.
program test_resume
   use klein_case, only: any_work, build, forever, same, set_drive
   use mesoslip_contacts_mechanics, only: coupling_scaled, initial_relaxed
   use mesoslip_loop_endings, only: ending_drive
   use mesoslip_loop_simulation, only: simulation_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_sundials_cvode, only: sundials_version
   use mesoslip_recording_steady, only: steady_recorder_type
   use testing, only: check, finish
   implicit none

   call continues("ensemble", "rigid", "series")
   call continues("ensemble", "prescribed", "series")
   call continues("ensemble", "layered", "series")
   call continues("ensemble", "quasistatic", "series")
   call continues("lattice", "rigid", "series")
   call continues("lattice", "quasistatic", "series")
   call continues("populations", "rigid", "series")
   call continues("populations", "layered", "series")
   call continues("ageing", "rigid", "series")
   call continues("ageing", "prescribed", "series")
   call continues("ageing", "quasistatic", "series")
   call continues("ageing populations", "rigid", "series")
   call continues("thermal", "rigid", "series")
   call continues("thermal", "prescribed", "series")
   call continues("thermal ageing", "rigid", "series")
   call continues("thermal ageing cold", "rigid", "series")
   call continues("thermal ageing populations", "rigid", "series")
   call refuses()
   if (len(sundials_version()) > 0) then
      call continues("ensemble", "layered", "adams")
      call continues("ensemble", "layered", "bdf")
   else
      print "(a)", "skipped: solvers of CVODE, as this is a build without SUNDIALS"
   end if
   call finish()

contains

   !> A run that is saved again and again, and continued by another simulation, is the same to the
   !> bit: its energy, its tables, and the counts of its integrator.
   subroutine continues(contacts, slider, solver)
      character(len=*), intent(in) :: contacts, slider, solver

      type(simulation_type) :: whole
      type(simulation_type), allocatable :: now, next
      type(error_type), allocatable :: error
      integer(i8), allocatable :: words(:)
      integer(i8) :: length
      integer :: segment, table
      character(len=:), allocatable :: name
      real(wp), parameter :: short(3) = [0.024_wp, 0.03_wp, 0.05_wp]
      character(len=10), parameter :: tables(7) = [character(len=10) :: &
         & "trace", "slip_trace", "slips", "layers", "avalanches", "snapshots", "stages"]

      name = contacts // ", " // slider // ", solver " // solver
      call build(whole, contacts, slider, "gaussian", 0.1_wp, coupling_scaled, solver)
      call set_drive(whole, short)
      call whole%start(initial_relaxed)
      call whole%run(forever, any_work, error)

      allocate (now)
      call build(now, contacts, slider, "gaussian", 0.1_wp, coupling_scaled, solver)
      call set_drive(now, short)
      call now%start(initial_relaxed)
      do segment = 1, 100000
         ! Longer and longer segments cut all phases of a run, and the test ends.
         call now%run(int(1 + segment**3 / 8, i8), any_work, error)
         if (allocated(error) .or. now%ending == ending_drive) exit
         call now%save(length, error)
         allocate (words(length))
         if (.not. allocated(error)) call now%fetch(words, error)
         allocate (next)
         call build(next, contacts, slider, "gaussian", 0.1_wp, coupling_scaled, solver)
         call set_drive(next, short)
         if (.not. allocated(error)) call next%restore(words, error)
         deallocate (words)
         deallocate (now)
         call move_alloc(next, now)
         if (allocated(error)) exit
      end do
      call check(.not. allocated(error), "a state can be saved and restored: " // name)
      call check(now%ending == ending_drive .and. segment > 10, "a run in segments ends: " // name)
      call check(all(abs(now%energy_balance() - whole%energy_balance()) <= 0.0_wp) &
         & .and. now%advances == whole%advances, "a run in segments is the same: " // name)
      call check(all(now%slider%integrator_counts == whole%slider%integrator_counts), &
         & "counts of the integrator are the same: " // name)
      do table = 1, size(tables)
         call check(same(now%table(trim(tables(table))), whole%table(trim(tables(table)))), &
            & "tables are the same: " // name // ", " // trim(tables(table)))
      end do
   end subroutine continues

   !> A state of another kind, of another length, or for a run under way, is refused.
   subroutine refuses()
      type(simulation_type) :: rigid, other, shorter, unset
      type(error_type), allocatable :: error
      integer(i8), allocatable :: words(:)
      integer(i8) :: length

      call build(rigid, "ensemble", "rigid", "gaussian", 0.1_wp, coupling_scaled, "series")
      call rigid%start(initial_relaxed)
      call rigid%run(100_i8, any_work, error)
      call rigid%save(length, error)
      allocate (words(length))
      call rigid%fetch(words, error)
      call check(.not. allocated(error), "a state is fetched")
      call rigid%fetch(words, error)
      call check(allocated(error), "a state is fetched once")
      call build(other, "ensemble", "prescribed", "gaussian", 0.1_wp, coupling_scaled, &
         & "series")
      call other%restore(words, error)
      call check(allocated(error), "a state of another slider is refused")
      call build(shorter, "ensemble", "rigid", "gaussian", 0.1_wp, coupling_scaled, &
         & "series")
      call shorter%restore(words(:length - 1), error)
      call check(allocated(error), "a state that is not whole is refused")
      call rigid%restore(words, error)
      call check(allocated(error), "a run under way is not set to another state")
      call build(unset, "ensemble", "rigid", "gaussian", 0.1_wp, coupling_scaled, "series")
      call check(unset%is_whole(), "a simulation that has all its parts is whole")
      unset%steady = steady_recorder_type()
      call check(.not. unset%is_whole(), "one without conditions to stop is not")
   end subroutine refuses

end program test_resume
