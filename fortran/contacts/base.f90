!> Interface of all kinds of contacts: offer the slider a law, and respond to its motion.
!>
!> Contacts do not depend on sliders; they are given only their poses. Displacements are relative to
!> an origin that the caller shifts (shift_origin).
module mesoslip_contacts_base
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_parameters, only: name_length, parameters_type
   use mesoslip_normal_load, only: normal_load_type, take_normal_load
   use mesoslip_contacts_mechanics, only: coupling_names, coupling_scaled, coupling_table, &
      & delay_fixed, delay_names
   use mesoslip_interface_law, only: clocks, hazard_clock_type, interface_law_type, pose_type, &
      & window_type
   use mesoslip_contacts_threshold_laws, only: make_threshold_law
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   use mesoslip_schedule, only: max_events, schedule_type
   use mesoslip_track_strength, only: take_track_strength, track_strength_type
   implicit none
   private

   public :: contacts_type, contact_parameters_type
   public :: take_contact_parameters, exchange_contacts
   public :: extent_length, snapshot_length, contact_record_length
   public :: extent_columns, snapshot_columns, contact_columns

   !> Extent of an avalanche: contacts that broke, columns and rows around them, generations
   character(len=*), parameter :: extent_columns(*) = [character(len=name_length) :: &
      & "area", "width", "height", "generations"]
   integer, parameter :: extent_length = size(extent_columns)
   !> A contact in a snapshot: stretch [m], huge if it is detached; force over threshold; generation
   !> in the current avalanche
   character(len=*), parameter :: snapshot_columns(*) = [character(len=name_length) :: &
      & "stretch", "load", "generation"]
   integer, parameter :: snapshot_length = size(snapshot_columns)
   !> Record of a contact: origin [m], stiffness [N/m] (0 while detached), breaking stretch [m],
   !> number of renewals
   character(len=*), parameter :: contact_columns(*) = [character(len=name_length) :: &
      & "origin", "stiffness", "break_stretch", "renewals"]
   integer, parameter :: contact_record_length = size(contact_columns)

   !> Parameters of the contacts.
   type :: contact_parameters_type
      !> Number of contacts N
      integer :: count = 0
      !> Mean static threshold f_s [N]
      real(wp) :: static_force = 0.0_wp
      !> Mean stiffness k [N/m]
      real(wp) :: stiffness = 0.0_wp
      !> Drag of a contact of mean mass, m eta [N s/m]
      real(wp) :: drag = 0.0_wp
      !> Mean delay between detaching and attaching [s], and one of the delay_ codes
      real(wp) :: delay = 0.0_wp
      integer :: delay_law = delay_fixed
      !> Backward force over mean static threshold, f_b/f_s; over the own one if it is kept
      real(wp) :: back_force_ratio = 0.0_wp
      !> Standard deviation of the force at attaching over the mean static threshold
      real(wp) :: newborn_width = 0.0_wp
      !> One of the coupling_ codes
      integer :: coupling = coupling_scaled
      !> Whether a broken contact attaches again
      logical :: reattach = .true.
      !> Whether a contact keeps the threshold that it drew first
      logical :: keeps_thresholds = .false.
      !> Strength along the track of the slider, which multiplies thresholds
      type(track_strength_type) :: strength
      !> Law of the relative thresholds
      class(threshold_law_type), allocatable :: law
      !> Normal load as the share of the contacts that it brings into contact
      type(normal_load_type) :: load
      !> Key of the random numbers
      integer(i8) :: seed = 0, realization = 0
   end type contact_parameters_type

   !> The contacts of an interface.
   type, abstract :: contacts_type
      !> Parameters of the contacts
      type(contact_parameters_type) :: parameters
      !> Number of detached contacts, and of breaks so far
      real(wp) :: detached_count = 0.0_wp, breaks = 0.0_wp
      !> Elastic energy lost by breaking, and gained by attaching under back force [J]
      type(accumulator_type) :: break_loss, birth_gain
      !> Elastic energy lost by separating, as the normal load falls [J]
      type(accumulator_type) :: separation_loss
      !> Error of steps: work done by the offered force minus that done on the contacts [J]; 0 for
      !> individual contacts
      type(accumulator_type) :: step_work
      !> Estimated error of the contact force [N]; 0 for individual contacts
      real(wp) :: error_estimate = 0.0_wp
      !> Cost of a response relative to that of one breaking contact
      real(wp) :: cost = 1.0_wp
      !> Length of a schedule that is used up before the normal load ends it, about
      integer :: schedule_length = max_events
      !> Whether an offer depends on the state alone, and holds until the next response
      logical :: keeps_offers = .false.
      !> Clocks of thermally activated breaking, which the slider advances; whether there are any
      type(hazard_clock_type) :: clock(clocks)
      logical :: has_clocks = .false.
      !> Set if the contacts cannot continue
      type(error_type), allocatable :: failure
   contains
      !> Prepare the contacts for the start of a run
      procedure(initialize_interface), deferred :: initialize
      !> Contact force as a law, for a slider that does not move
      procedure(law_interface), deferred :: law
      !> Contact force as a law, and where it holds
      procedure(offer_interface), deferred :: offer
      !> Break and attach contacts after a motion of the slider
      procedure(respond_interface), deferred :: respond
      !> Write a schedule of the next events; update the contacts after it
      procedure :: plan
      procedure :: settle
      !> Move the origin of displacements
      procedure(shift_origin_interface), deferred :: shift_origin
      !> Elastic energy of the pinned contacts
      procedure(elastic_energy_interface), deferred :: elastic_energy
      !> Write the state to an archive, or read it
      procedure(exchange_interface), deferred :: exchange
      !> Recompute derived quantities from the state, after it was read from an archive
      procedure(rebuild_interface), deferred :: rebuild
      !> Extent of the finished avalanche, which is cleared
      procedure :: take_extent
      !> Number of individual contacts
      procedure :: individual_count
      !> State of all individual contacts, and records of some
      procedure :: snapshot
      procedure :: records
      !> Add up energies and errors that are kept in parts
      procedure :: gather
   end type contacts_type

   abstract interface
      subroutine initialize_interface(self, state)
         import :: contacts_type
         implicit none
         class(contacts_type), intent(inout) :: self
         !> One of the initial_ codes
         integer, intent(in) :: state
      end subroutine initialize_interface

      pure function law_interface(self) result(law)
         import :: contacts_type, interface_law_type
         implicit none
         class(contacts_type), intent(in) :: self
         type(interface_law_type) :: law
      end function law_interface

      subroutine offer_interface(self, pose, law, window)
         import :: contacts_type, interface_law_type, pose_type, window_type
         implicit none
         class(contacts_type), intent(inout) :: self
         !> Pose of the slider
         type(pose_type), intent(in) :: pose
         type(interface_law_type), intent(out) :: law
         !> Range in which it holds
         type(window_type), intent(out) :: window
      end subroutine offer_interface

      subroutine respond_interface(self, before, after)
         import :: contacts_type, pose_type
         implicit none
         class(contacts_type), intent(inout) :: self
         !> Poses of the slider when it was offered a law, and now
         type(pose_type), intent(in) :: before, after
      end subroutine respond_interface

      subroutine shift_origin_interface(self, shift, displacement)
         import :: contacts_type, wp
         implicit none
         class(contacts_type), intent(inout) :: self
         !> Displacement of the new origin [m]
         real(wp), intent(in) :: shift
         !> Displacement of the slider from the new origin [m]
         real(wp), intent(in) :: displacement
      end subroutine shift_origin_interface

      pure function elastic_energy_interface(self, displacement) result(energy)
         import :: contacts_type, wp
         implicit none
         class(contacts_type), intent(in) :: self
         !> Displacement of the slider [m]
         real(wp), intent(in) :: displacement
         !> Energy [J]
         real(wp) :: energy
      end function elastic_energy_interface

      subroutine exchange_interface(self, archive)
         import :: archive_type, contacts_type
         implicit none
         class(contacts_type), intent(inout) :: self
         type(archive_type), intent(inout) :: archive
      end subroutine exchange_interface

      subroutine rebuild_interface(self, displacement)
         import :: contacts_type, wp
         implicit none
         class(contacts_type), intent(inout) :: self
         !> Displacement of the slider [m]
         real(wp), intent(in) :: displacement
      end subroutine rebuild_interface
   end interface

contains

   !> Write a schedule of the next events; by default there is none.
   subroutine plan(self, pose, limit, schedule)
      class(contacts_type), intent(inout) :: self
      !> Pose of the slider
      type(pose_type), intent(in) :: pose
      !> Maximum number of breaks, and of attachments
      integer, intent(in) :: limit
      !> The schedule; over if there is none
      type(schedule_type), intent(inout) :: schedule

      schedule%is_over = .true.
   end subroutine plan

   !> Update the contacts after a schedule; nothing for contacts that write none.
   subroutine settle(self, schedule, pose)
      class(contacts_type), intent(inout) :: self
      !> The schedule, up to where the slider is; moments in which contacts broke may be added
      type(schedule_type), intent(inout) :: schedule
      !> Pose of the slider
      type(pose_type), intent(in) :: pose

   end subroutine settle

   !> Return the extent of the finished avalanche, and clear it; 0 without a lattice.
   subroutine take_extent(self, extent)
      class(contacts_type), intent(inout) :: self
      !> Numbers in the order of extent_columns
      integer, intent(out) :: extent(extent_length)

      extent = 0
   end subroutine take_extent

   !> Number of individual contacts; 0 by default.
   pure function individual_count(self) result(number)
      class(contacts_type), intent(in) :: self
      integer :: number

      number = 0
   end function individual_count

   !> Add up energies and errors that are kept in parts; by default there are none.
   subroutine gather(self)
      class(contacts_type), intent(inout) :: self

   end subroutine gather

   !> State of each individual contact.
   pure subroutine snapshot(self, time, displacement, values)
      class(contacts_type), intent(in) :: self
      !> Time [s], displacement of the slider [m]
      real(wp), intent(in) :: time, displacement
      !> Numbers in the order of snapshot_columns, shape (snapshot_length, individual_count)
      real(wp), intent(out) :: values(:, :)

      values = 0.0_wp
   end subroutine snapshot

   !> Records of some individual contacts.
   pure subroutine records(self, time, first, values)
      class(contacts_type), intent(in) :: self
      !> Time [s]
      real(wp), intent(in) :: time
      !> The first of the contacts
      integer, intent(in) :: first
      !> Numbers in the order of contact_columns, shape (contact_record_length, contacts)
      real(wp), intent(out) :: values(:, :)

      values = 0.0_wp
   end subroutine records

   !> Write the state that all kinds of contacts have to an archive, or read it.
   subroutine exchange_contacts(self, archive)
      class(contacts_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%exchange("detached_count", self%detached_count)
      call archive%exchange("breaks", self%breaks)
      call archive%exchange("break_loss", self%break_loss)
      call archive%exchange("birth_gain", self%birth_gain)
      if (self%parameters%load%changes) then
         call archive%exchange("separation_loss", self%separation_loss)
      end if
      call archive%exchange("step_work", self%step_work)
      call archive%exchange("error_estimate", self%error_estimate)
      call archive%exchange("cost", self%cost)
      if (self%parameters%strength%is_used) then
         call archive%exchange("track_origin", self%parameters%strength%origin)
      end if
   end subroutine exchange_contacts

   !> Take the parameters that all kinds of contacts have.
   subroutine take_contact_parameters(self, parameters, seed, realization, error)
      type(contact_parameters_type), intent(out) :: self
      !> Named parameters
      type(parameters_type), intent(inout) :: parameters
      !> Key of the random numbers
      integer(i8), intent(in) :: seed, realization
      !> Set if a parameter is missing or wrong
      type(error_type), allocatable, intent(inout) :: error

      character(len=name_length) :: law

      self%seed = seed
      self%realization = realization
      call parameters%take("count", self%count, error)
      call parameters%take("static_force", self%static_force, error)
      call parameters%take("stiffness", self%stiffness, error)
      call parameters%take("drag", self%drag, error)
      call parameters%take("delay", self%delay, error)
      call parameters%take("delay_law", delay_names, self%delay_law, error)
      call parameters%take("back_force_ratio", self%back_force_ratio, error)
      call parameters%take("newborn_width", self%newborn_width, error)
      call parameters%take("coupling", coupling_names, self%coupling, error)
      call parameters%take("reattach", self%reattach, error)
      if (parameters%has("keeps_thresholds")) then
         call parameters%take("keeps_thresholds", self%keeps_thresholds, error)
      end if
      call take_track_strength(self%strength, parameters, seed, realization, error)
      call parameters%take("threshold_law", law, error)
      if (allocated(error)) return
      ! Below its own threshold the force at attaching rejects none.
      call make_threshold_law(self%law, law, parameters, &
         & merge(0.0_wp, self%back_force_ratio, self%keeps_thresholds), error)
      call take_normal_load(self%load, parameters, error)
      if (allocated(error)) return
      if (self%law%has_stiffnesses .neqv. self%coupling == coupling_table) then
         call raise(error, status_invalid, "stiffnesses of a table of thresholds are for the " &
            & // "coupling 'table', which needs them")
      end if
   end subroutine take_contact_parameters

end module mesoslip_contacts_base
