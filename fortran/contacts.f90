!> The kinds of contacts by name.
module mesoslip_contacts
   use mesoslip_contacts_ageing_contacts, only: make_contact_ageing
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type, take_contact_parameters
   use mesoslip_contacts_ensemble, only: make_contact_ensemble
   use mesoslip_contacts_lattice, only: make_contact_lattice
   use mesoslip_contacts_populations, only: make_contact_populations
   use mesoslip_contacts_thermal_ageing, only: make_thermal_ageing_contacts
   use mesoslip_contacts_thermal_contacts, only: make_thermal_contacts
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_kinds, only: i8
   use mesoslip_numerics_parameters, only: parameters_type
   implicit none
   private

   public :: make_contacts

contains

   !> Set up contacts of a kind.
   subroutine make_contacts(contacts, kind, parameters, seed, realization, error)
      !> The contacts
      class(contacts_type), allocatable, intent(out) :: contacts
      !> Their kind
      character(len=*), intent(in) :: kind
      !> Named parameters of the contacts
      type(parameters_type), intent(inout) :: parameters
      !> Key of the random numbers
      integer(i8), intent(in) :: seed, realization
      !> Set if there is no such kind, or a parameter is missing, superfluous or wrong
      type(error_type), allocatable, intent(out) :: error

      type(contact_parameters_type) :: common

      call take_contact_parameters(common, parameters, seed, realization, error)
      if (allocated(error)) return
      select case (kind)
      case ("ageing")
         call make_contact_ageing(contacts, common, parameters, error)
      case ("ageing populations")
         call make_contact_populations(contacts, common, parameters, .true., .false., error)
      case ("ensemble")
         call make_contact_ensemble(contacts, common, parameters, error)
      case ("lattice")
         call make_contact_lattice(contacts, common, parameters, error)
      case ("populations")
         call make_contact_populations(contacts, common, parameters, .false., .false., error)
      case ("thermal")
         call make_thermal_contacts(contacts, common, parameters, error)
      case ("thermal ageing")
         call make_thermal_ageing_contacts(contacts, common, parameters, error)
      case ("thermal ageing populations")
         call make_contact_populations(contacts, common, parameters, .true., .true., error)
      case ("thermal populations")
         call make_contact_populations(contacts, common, parameters, .false., .true., error)
      case default
         call raise(error, status_invalid, "unknown kind of contacts '" // kind // "'")
      end select
   end subroutine make_contacts

end module mesoslip_contacts
