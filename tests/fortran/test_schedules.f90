!> Schedules: a run is the same to the bit whatever their length, and wherever it is cut.
program test_schedules
   use klein_case, only: any_work, count, forever, prepare, same
   use mesoslip_contacts_base, only: contact_parameters_type
   use mesoslip_contacts_individual_sites, only: contact_sites_type, new_contact_sites
   use mesoslip_contacts_mechanics, only: initial_steady
   use mesoslip_loop_endings, only: ending_drive
   use mesoslip_loop_simulation, only: simulation_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_normal_load, only: take_normal_load
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: name_length, new_parameters, parameters_type
   use mesoslip_schedule, only: max_events
   use testing, only: check, finish
   implicit none

   call runs_ahead("ensemble", "rigid", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("ensemble", "rigid", "exponential", 1.0_wp, 5.0e-4_wp)
   call runs_ahead("ensemble", "rigid", "exponential", 1.0_wp, 0.0_wp)
   call runs_ahead("ensemble", "prescribed", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("ensemble", "prescribed", "exponential", 1.0_wp, 1.0e-5_wp)
   call runs_ahead("scattered", "rigid", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("scattered", "prescribed", "exponential", 1.0_wp, 1.0e-5_wp)
   call runs_ahead("loaded", "rigid", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("loaded", "rigid", "exponential", 1.0_wp, 0.0_wp)
   call runs_ahead("loaded", "prescribed", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("loaded", "prescribed", "exponential", 1.0_wp, 5.0e-4_wp)
   call runs_ahead("loaded scattered", "rigid", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("ageing", "prescribed", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("ageing", "rigid", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("ageing", "rigid", "gaussian", 0.1_wp, 0.0_wp)
   call runs_ahead("ageing", "rigid", "exponential", 1.0_wp, 5.0e-4_wp)
   call runs_ahead("ageing", "prescribed", "exponential", 1.0_wp, 0.0_wp)
   call runs_ahead("ageing loaded", "rigid", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("ageing loaded", "prescribed", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("thermal", "rigid", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("thermal", "rigid", "exponential", 1.0_wp, 0.0_wp)
   call runs_ahead("thermal cold", "rigid", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("thermal cold", "rigid", "gaussian", 0.1_wp, 0.0_wp)
   call runs_ahead("thermal", "prescribed", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("thermal", "prescribed", "exponential", 1.0_wp, 1.0e-5_wp)
   call runs_ahead("thermal scattered", "rigid", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("thermal scattered", "prescribed", "exponential", 1.0_wp, 1.0e-5_wp)
   call runs_ahead("thermal ageing", "rigid", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("thermal ageing", "rigid", "exponential", 1.0_wp, 0.0_wp)
   call runs_ahead("thermal ageing cold", "rigid", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("thermal ageing", "prescribed", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("thermal ageing", "prescribed", "exponential", 1.0_wp, 1.0e-5_wp)
   call preview_changes_nothing()
   call has_length_by_load("loaded", .false.)
   call has_length_by_load("loaded scattered", .true.)
   call finish()

contains

   !> Sites touch and separate as if nobody had looked ahead, by however many events: here also by
   !> as many that touch in a jump as separate after it.
   subroutine preview_changes_nothing()
      integer, parameter :: limit = 60, parts = 3
      character(len=name_length), parameter :: names(3) = [character(len=name_length) :: &
         & "load_part_end", "load_start_share", "load_end_share"]
      type(contact_parameters_type) :: contacts
      type(parameters_type) :: load
      type(contact_sites_type) :: sites, looked
      type(error_type), allocatable :: error
      integer :: ahead, number, site, expected, seen(limit + 1), events
      real(wp) :: time(limit + 1)
      logical :: touches, seen_touches(limit + 1), is_same

      call new_parameters(load, [spread(names(1), 1, parts), spread(names(2), 1, parts), &
         & spread(names(3), 1, parts)], [1.0_wp, 2.0_wp, 3.0_wp, 0.5_wp, 0.6_wp, 0.2_wp, 0.5_wp, &
         & 0.4_wp, 0.9_wp])
      call take_normal_load(contacts%load, load, error)
      contacts%count = 200
      call new_contact_sites(sites, contacts, error)
      call check(.not. allocated(error), "sites under a load in parts")
      events = 0
      is_same = .true.
      do while (sites%next_time < huge(1.0_wp))
         looked = sites
         do ahead = 1, limit
            call looked%preview(contacts, ahead, seen, seen_touches, time, number)
            is_same = is_same .and. looked%next_time >= sites%next_time &
               & .and. looked%next_time <= sites%next_time .and. looked%count == sites%count
         end do
         call sites%take_next(contacts, expected, touches)
         call looked%take_next(contacts, site, touches)
         is_same = is_same .and. site == expected
         events = events + 1
      end do
      call check(events > 150, "sites touch and separate")
      call check(is_same, "a preview of sites changes nothing")
   end subroutine preview_changes_nothing

   !> Schedules are as long as events of the load let them be, where these are not in them.
   subroutine has_length_by_load(contacts, is_short)
      character(len=*), intent(in) :: contacts
      logical, intent(in) :: is_short

      type(simulation_type) :: run
      type(error_type), allocatable :: error

      call prepare(run, contacts, "rigid", "gaussian", 0.1_wp, 5.0e-4_wp, max_events)
      call run%start(initial_steady)
      call run%run(forever, any_work, error)
      call check(.not. allocated(error) .and. (run%contacts%schedule_length < max_events / 2 &
         & .eqv. is_short), "length of schedules under a load: " // contacts)
   end subroutine has_length_by_load

   !> A run is the same to the bit whatever the length of its schedules, 0 included, and wherever it
   !> is saved and continued.
   subroutine runs_ahead(contacts, slider, law, width, delay)
      character(len=*), intent(in) :: contacts, slider, law
      real(wp), intent(in) :: width, delay

      integer, parameter :: lengths(6) = [1, 2, 7, 32, 64, 64]
      type(simulation_type) :: whole
      type(simulation_type), allocatable :: now, next
      type(error_type), allocatable :: error
      integer(i8), allocatable :: words(:)
      integer(i8) :: length
      integer :: number, segment, table
      character(len=:), allocatable :: name
      character(len=10), parameter :: tables(4) = [character(len=10) :: &
         & "trace", "slip_trace", "slips", "stages"]

      call prepare(whole, contacts, slider, law, width, delay, 0)
      call whole%start(initial_steady)
      call whole%run(forever, any_work, error)
      do number = 1, size(lengths)
         name = contacts // ", " // slider // ", length " &
            & // achar(iachar("0") + lengths(number) / 10) &
            & // achar(iachar("0") + modulo(lengths(number), 10))
         allocate (now)
         call prepare(now, contacts, slider, law, width, delay, lengths(number))
         call now%start(initial_steady)
         if (number < size(lengths)) call now%run(forever, any_work, error)
         do segment = 1, 100000
            if (allocated(error) .or. now%ending == ending_drive) exit
            call now%run(int(1 + segment**3 / 8, i8), any_work, error)
            call now%save(length, error)
            allocate (words(length))
            call now%fetch(words, error)
            allocate (next)
            call prepare(next, contacts, slider, law, width, delay, modulo(segment, max_events))
            call next%restore(words, error)
            deallocate (words)
            deallocate (now)
            call move_alloc(next, now)
         end do
         call check(.not. allocated(error) .and. now%ending == ending_drive, &
            & "a run with schedules ends: " // name)
         call check(all(abs(now%energy_balance() - whole%energy_balance()) <= 0.0_wp) &
            & .and. now%advances == whole%advances &
            & .and. now%avalanches%avalanches == whole%avalanches%avalanches, &
            & "schedules do not change a run: " // name)
         do table = 1, size(tables)
            call check(same(now%table(trim(tables(table))), whole%table(trim(tables(table)))), &
               & "tables are the same: " // name // ", " // trim(tables(table)))
         end do
         deallocate (now)
      end do
      call check(whole%contacts%breaks > 10 * count, "many contacts break: " // slider)
   end subroutine runs_ahead

end program test_schedules
