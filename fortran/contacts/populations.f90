!> Infinitely many contacts: the master equation under a slider with any motion.
!>
!> Contacts are populations while they are pinned, and packets while they are detached.
module mesoslip_contacts_populations
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_contacts_ageing_law, only: ageing_law_type, take_ageing_law
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type, exchange_contacts
   use mesoslip_contacts_mechanics, only: coupling_equal, coupling_table
   use mesoslip_contacts_populations_loading, only: begin_load, set_up_load
   use mesoslip_contacts_populations_offer, only: offer_step
   use mesoslip_contacts_populations_packets, only: new_detached_packets
   use mesoslip_contacts_populations_pinned, only: new_pinned_populations
   use mesoslip_contacts_populations_respond, only: respond_to_motion
   use mesoslip_contacts_populations_state, only: population_state_type
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   implicit none
   private

   public :: contact_populations_type, new_contact_populations, make_contact_populations

   !> Maximum part of the contacts that attach in a step of resolution 1
   real(wp), parameter :: max_attached_part = 0.1_wp
   !> Height of the mean force in a step of resolution 1 above its chord that is tolerated, over the
   !> static force
   real(wp), parameter :: tolerated_part = 3.0e-3_wp
   !> Part of a step in which nothing may attach without ending it. Activated contacts break in
   !> every step, and rounding gaps between steps would return after each delay
   real(wp), parameter :: thermal_gap = 1.0e-3_wp

   !> Populations of contacts.
   type, extends(population_state_type) :: contact_populations_type
   contains
      procedure :: initialize, offer, respond, shift_origin, elastic_energy, exchange, rebuild
   end type contact_populations_type

contains

   !> Set up populations.
   subroutine new_contact_populations(self, parameters, resolution, error)
      type(contact_populations_type), intent(out) :: self
      !> Parameters of the contacts
      type(contact_parameters_type), intent(in) :: parameters
      !> Length of a step over the spread of the breaking stretches, positive
      real(wp), intent(in) :: resolution
      !> Set if the resolution is not positive
      type(error_type), allocatable, intent(out) :: error

      if (.not. resolution > 0.0_wp) then
         call raise(error, status_invalid, "the resolution of populations must be positive")
         return
      end if
      if (parameters%strength%is_used .and. parameters%coupling == coupling_table) then
         call raise(error, status_invalid, "populations with the stiffnesses of a table have the " &
            & // "same strength everywhere")
         return
      end if
      self%parameters = parameters
      self%resolution = resolution
      self%max_attached = parameters%count * resolution * max_attached_part
      self%max_attached_at_rest = self%max_attached * min(resolution, max_attached_part)
      self%max_late = self%max_attached * resolution
      call new_pinned_populations(self%pinned, parameters, resolution)
      self%tolerance = tolerated_part * resolution**2 * parameters%count * parameters%static_force
      call new_detached_packets(self%detached, parameters)
   end subroutine new_contact_populations

   !> Set up populations from named numbers.
   subroutine make_contact_populations(contacts, common, parameters, ages, is_thermal, error)
      class(contacts_type), allocatable, intent(out) :: contacts
      type(contact_parameters_type), intent(in) :: common
      !> The other numbers: resolution, the law of ageing, rate and force of activation
      type(parameters_type), intent(inout) :: parameters
      !> Whether thresholds change with age, and whether contacts break by thermal activation
      logical, intent(in) :: ages, is_thermal
      type(error_type), allocatable, intent(inout) :: error

      type(contact_populations_type), allocatable :: self
      type(contact_parameters_type) :: all
      type(ageing_law_type) :: ageing
      real(wp) :: resolution, rate, force

      all = common
      call parameters%take("resolution", resolution, error)
      if (ages) call take_ageing_law(ageing, all%law, parameters, error)
      if (is_thermal) then
         call parameters%take("activation_rate", rate, error)
         call parameters%take("activation_force", force, error)
      end if
      call parameters%finish(error)
      if (allocated(error)) return
      allocate (self)
      call new_contact_populations(self, all, resolution, error)
      if (allocated(error)) return
      if (ages) call self%pinned%set_ageing(ageing)
      if (is_thermal) call activate(self, rate, force, error)
      if (.not. allocated(error)) call set_up_load(self, error)
      call move_alloc(self, contacts)
   end subroutine make_contact_populations

   !> Let populations break by thermal activation, with its rate [1/s] and force [N].
   subroutine activate(self, rate, force, error)
      type(contact_populations_type), intent(inout) :: self
      real(wp), intent(in) :: rate, force
      type(error_type), allocatable, intent(inout) :: error

      if (.not. (rate > 0.0_wp .and. force > 0.0_wp &
         & .and. self%parameters%coupling == coupling_equal) &
         & .or. self%parameters%strength%is_used) then
         call raise(error, status_invalid, "activation of populations needs equal contacts, the " &
            & // "same strength everywhere, and a positive rate and force")
         return
      end if
      call self%pinned%activate(rate, force / self%parameters%static_force, self%resolution)
      self%detached%short_gap = thermal_gap
   end subroutine activate

   subroutine initialize(self, state)
      class(contact_populations_type), intent(inout) :: self
      integer, intent(in) :: state

      if (self%pinned%has_track) then
         call self%pinned%sum_newborns(self%parameters%strength%factor(0.0_wp))
      end if
      call self%pinned%initialize(state, self%failure)
      call begin_load(self)
   end subroutine initialize

   subroutine offer(self, pose, law, window)
      class(contact_populations_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      type(interface_law_type), intent(out) :: law
      type(window_type), intent(out) :: window

      call offer_step(self, pose, law, window)
   end subroutine offer

   subroutine respond(self, before, after)
      class(contact_populations_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      call respond_to_motion(self, before, after)
   end subroutine respond

   subroutine shift_origin(self, shift, displacement)
      class(contact_populations_type), intent(inout) :: self
      real(wp), intent(in) :: shift, displacement

      self%parameters%strength%origin = self%parameters%strength%origin + shift
      call self%pinned%shift_origin(shift)
   end subroutine shift_origin

   pure function elastic_energy(self, displacement) result(energy)
      class(contact_populations_type), intent(in) :: self
      real(wp), intent(in) :: displacement
      real(wp) :: energy

      energy = self%pinned%elastic_energy(displacement)
   end function elastic_energy

   subroutine exchange(self, archive)
      class(contact_populations_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%section("contact populations")
      call exchange_contacts(self, archive)
      call self%pinned%exchange(archive)
      call archive%exchange("next_step", self%next_step)
      call self%detached%exchange(archive)
      if (self%pinned%has_track) call archive%exchange("factor", self%pinned%factor)
      if (self%parameters%load%changes) then
         call archive%exchange("share", self%share)
         call archive%exchange("load_piece", self%load_piece)
      end if
      if (.not. self%pinned%is_thermal) return
      call archive%exchange("last_duration", self%last_duration)
      call archive%exchange("last_velocity", self%last_velocity)
      call archive%exchange("excess", self%excess)
   end subroutine exchange

   subroutine rebuild(self, displacement)
      class(contact_populations_type), intent(inout) :: self
      real(wp), intent(in) :: displacement

      if (self%pinned%has_track) call self%pinned%sum_newborns(self%pinned%factor)
      call self%pinned%forget_trial()
   end subroutine rebuild

end module mesoslip_contacts_populations
