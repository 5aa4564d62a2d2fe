!> Contacts with exponential delays: the part of them that attaches in a step, and its mean time.
!>
!> The ratio h is that of the duration of a step to the mean delay; times are over the duration. Of
!> the contacts detached at the start the part 1 - exp(-h) attaches; of those that break evenly in
!> the step the part 1 - (1 - exp(-h))/h. Short steps have series, as differences lose digits.
module mesoslip_contacts_populations_waiting
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: attached_part, own_attached_part, mean_attached_time, mean_own_time

   !> Ratio below which there is a series, and its number of terms
   real(wp), parameter :: short = 0.5_wp
   integer, parameter :: terms = 16
   !> Ratio beyond which all contacts have attached
   real(wp), parameter :: long = 700.0_wp

contains

   !> Part that attaches of the contacts detached at the start.
   elemental function attached_part(ratio) result(part)
      real(wp), intent(in) :: ratio
      real(wp) :: part

      if (ratio < short) then
         part = series(ratio, 0)
      else
         part = 1.0_wp - exp(-min(ratio, long))
      end if
   end function attached_part

   !> Part that attaches of the contacts that break in the step.
   elemental function own_attached_part(ratio) result(part)
      real(wp), intent(in) :: ratio
      real(wp) :: part

      if (ratio < short) then
         part = series(ratio, 1)
      else
         part = 1.0_wp - attached_part(ratio) / ratio
      end if
   end function own_attached_part

   !> Mean time at which the former attach, 1/2 for short steps.
   elemental function mean_attached_time(ratio) result(time)
      real(wp), intent(in) :: ratio
      real(wp) :: time

      time = 0.5_wp
      if (ratio > 0.0_wp) time = 1.0_wp - own_attached_part(ratio) / attached_part(ratio)
   end function mean_attached_time

   !> Mean time at which the latter attach, 2/3 for short steps.
   elemental function mean_own_time(ratio) result(time)
      real(wp), intent(in) :: ratio
      real(wp) :: time

      time = 2.0_wp / 3.0_wp
      if (.not. ratio > 0.0_wp) return
      if (ratio < short) then
         time = series(ratio, 2) / own_attached_part(ratio)
      else
         time = (0.5_wp - attached_part(ratio) / ratio**2 &
            & + (1.0_wp - attached_part(ratio)) / ratio) / own_attached_part(ratio)
      end if
   end function mean_own_time

   !> 1 - exp(-h) for order 0, or the integral of s**(order - 1) (1 - exp(-h s)) over s from 0 to 1.
   elemental function series(ratio, order) result(total)
      real(wp), intent(in) :: ratio
      integer, intent(in) :: order
      real(wp) :: total

      real(wp) :: term
      integer :: power

      total = 0.0_wp
      term = -1.0_wp
      do power = 1, terms
         term = -term * ratio / power
         total = total + term / merge(1, power + order, order == 0)
      end do
   end function series

end module mesoslip_contacts_populations_waiting
