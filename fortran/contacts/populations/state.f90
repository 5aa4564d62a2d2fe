!> State of populations of contacts while a slider moves: pinned and detached contacts, and the
!> force that the slider was offered.
module mesoslip_contacts_populations_state
   use mesoslip_contacts_base, only: contacts_type
   use mesoslip_contacts_populations_packets, only: detached_packets_type
   use mesoslip_contacts_populations_pinned, only: pinned_populations_type
   use mesoslip_interface_law, only: interface_law_type, pose_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: population_state_type

   !> Populations of contacts, and how long their steps are.
   type, abstract, extends(contacts_type) :: population_state_type
      type(pinned_populations_type) :: pinned
      type(detached_packets_type) :: detached

      !> Law that was offered for the step, and whether one was
      type(interface_law_type) :: offered
      logical :: offers = .false.

      !> Maximum numbers of contacts that attach in one step, when the slider moves and when it
      !> rests
      real(wp) :: max_attached = 0.0_wp, max_attached_at_rest = 0.0_wp
      !> Maximum number of breaks in one step of populations that start to break in it
      real(wp) :: max_late = 0.0_wp
      !> Displacement of the next step, which follows the bend of the force [m], and height of the
      !> mean force above its chord that a step longer than by the resolution should not exceed [N]
      real(wp) :: next_step = huge(1.0_wp), tolerance = 0.0_wp
      !> Maximum duration of a step while thresholds fall, over the time of ageing, and for this
      !> step [s]
      real(wp) :: resolution = 1.0_wp, max_fall_time = huge(1.0_wp)
      !> With thermal activation: duration of the last step [s], mean velocity in it [m/s], and
      !> offered force minus contact force at its end [N]
      real(wp) :: last_duration = huge(1.0_wp), last_velocity = 0.0_wp, excess = 0.0_wp
      !> Share of the sites in contact, and piece of the normal load
      real(wp) :: share = 1.0_wp
      integer :: load_piece = 1
      !> Edges of bins of the heights of sites, from 0 on, as shares; shape (bins + 1)
      real(wp), allocatable :: edge(:)
   contains
      procedure, non_overridable :: bins
      procedure :: law
      procedure, non_overridable :: oscillation_rate
   end type population_state_type

contains

   pure function law(self)
      class(population_state_type), intent(in) :: self
      type(interface_law_type) :: law

      law%stiffness = self%pinned%stiffness%total()
      law%offset = self%pinned%offset%total()
      law%drag = self%parameters%drag * self%detached%mass%total()
   end function law

   !> Number of bins of heights; 0 without a changing load.
   pure function bins(self) result(number)
      class(population_state_type), intent(in) :: self
      integer :: number

      number = 0
      if (allocated(self%edge)) number = size(self%edge) - 1
   end function bins

   !> Rate at which the slider oscillates or is damped on the contacts [1/s]; 0 for a slider with
   !> prescribed motion.
   pure function oscillation_rate(self, pose) result(rate)
      class(population_state_type), intent(in) :: self
      type(pose_type), intent(in) :: pose
      real(wp) :: rate

      rate = sqrt(pose%own_rate**2 + max(0.0_wp, self%pinned%stiffness%total()) &
         & * pose%inverse_mass) &
         & + self%parameters%drag * max(0.0_wp, self%detached%mass%total()) * pose%inverse_mass
   end function oscillation_rate

end module mesoslip_contacts_populations_state
