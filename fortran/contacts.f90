!> The kinds of contacts by name.
module mesoslip_contacts
   use mesoslip_contacts_ageing_contacts, only: make_contact_ageing
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type, take_contact_parameters
   use mesoslip_contacts_ensemble, only: make_contact_ensemble
   use mesoslip_contacts_lattice, only: make_contact_lattice
   use mesoslip_contacts_populations, only: make_contact_populations
   use mesoslip_contacts_row, only: block_key, contact_row_type
   use mesoslip_contacts_thermal_activated, only: make_activated_contacts
   use mesoslip_contacts_thermal_ageing, only: make_thermal_ageing_contacts
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid, status_memory
   use mesoslip_numerics_kinds, only: i8, wp
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
      if (parameters%has("block_counts")) then
         call new_row(contacts, kind, common, parameters, error)
      else
         call new_contacts_of_kind(contacts, kind, common, parameters, error)
      end if
   end subroutine make_contacts

   !> Set up the contacts of each block of a row.
   subroutine new_row(contacts, kind, common, parameters, error)
      class(contacts_type), allocatable, intent(out) :: contacts
      character(len=*), intent(in) :: kind
      !> Parameters of all contacts together
      type(contact_parameters_type), intent(in) :: common
      type(parameters_type), intent(inout) :: parameters
      type(error_type), allocatable, intent(inout) :: error

      type(contact_row_type), allocatable :: row
      type(contact_parameters_type) :: own
      type(parameters_type) :: others
      real(wp), allocatable :: counts(:)
      real(wp) :: spacing
      integer :: block, stat

      call parameters%take("block_counts", counts, error)
      call parameters%take("block_spacing", spacing, error)
      if (allocated(error)) return
      if (size(counts) < 1 .or. any(counts < 1.0_wp) .or. nint(sum(counts)) /= common%count) then
         call raise(error, status_invalid, "blocks need a contact each, all contacts together")
         return
      end if
      allocate (row)
      allocate (row%block(size(counts)), stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the contacts of the blocks")
         return
      end if
      row%parameters = common
      do block = 1, size(counts)
         own = common
         own%count = nint(counts(block))
         own%realization = block_key(common%realization, block)
         ! The blocks go along one track.
         own%strength%origin = common%strength%origin + (block - 1) * spacing
         others = parameters
         call new_contacts_of_kind(row%block(block)%contacts, kind, own, others, error)
         if (allocated(error)) return
         row%has_clocks = row%block(block)%contacts%has_clocks
         row%keeps_offers = row%block(block)%contacts%keeps_offers
      end do
      call move_alloc(row, contacts)
   end subroutine new_row

   !> Set up contacts of a kind from the parameters that all kinds have and those of its own.
   subroutine new_contacts_of_kind(contacts, kind, common, parameters, error)
      class(contacts_type), allocatable, intent(out) :: contacts
      character(len=*), intent(in) :: kind
      type(contact_parameters_type), intent(in) :: common
      type(parameters_type), intent(inout) :: parameters
      type(error_type), allocatable, intent(inout) :: error

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
         call make_activated_contacts(contacts, common, parameters, error)
      case ("thermal ageing")
         call make_thermal_ageing_contacts(contacts, common, parameters, error)
      case ("thermal ageing populations")
         call make_contact_populations(contacts, common, parameters, .true., .true., error)
      case ("thermal populations")
         call make_contact_populations(contacts, common, parameters, .false., .true., error)
      case default
         call raise(error, status_invalid, "unknown kind of contacts '" // kind // "'")
      end select
   end subroutine new_contacts_of_kind

end module mesoslip_contacts
