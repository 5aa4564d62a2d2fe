!> The record of a contact: a column of numbers, in one cache line or two.
module mesoslip_contacts_individual_record
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: record_length, row_origin, row_stiffness, row_limit, row_renewal, row_next
   public :: ahead_coordinate, behind_coordinate

   !> Numbers in a record
   integer, parameter :: record_length = 5
   !> Displacement of the slider at which the stretch is zero [m]
   integer, parameter :: row_origin = 1
   !> Stiffness [N/m]; zero while the contact is detached
   integer, parameter :: row_stiffness = 2
   !> Stretch at which the contact breaks, in either direction [m]
   integer, parameter :: row_limit = 3
   !> Number of renewals, a whole number
   integer, parameter :: row_renewal = 4
   !> Relative threshold of the next birth; 0 if it has not been drawn
   integer, parameter :: row_next = 5

contains

   !> Coordinate along the direction of motion at which a pinned contact breaks [m].
   pure function ahead_coordinate(record, direction) result(coordinate)
      real(wp), intent(in) :: record(record_length)
      !> Direction of motion, +1 or -1
      real(wp), intent(in) :: direction
      real(wp) :: coordinate

      coordinate = direction * record(row_origin) + record(row_limit)
   end function ahead_coordinate

   !> Coordinate along the direction of motion at which it breaks after a reversal [m].
   pure function behind_coordinate(record, direction) result(coordinate)
      real(wp), intent(in) :: record(record_length)
      !> Direction of motion, +1 or -1
      real(wp), intent(in) :: direction
      real(wp) :: coordinate

      coordinate = direction * record(row_origin) - record(row_limit)
   end function behind_coordinate

end module mesoslip_contacts_individual_record
