!> The motion of a chain of layers as Taylor series.
module mesoslip_sliders_layered_expansion
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_layered_system, only: accelerate, push, push_at_a_rate, system_type
   use mesoslip_sliders_motion_series, only: inverse
   implicit none
   private

   public :: expand, sum_series

contains

   !> Taylor coefficients of the motion.
   subroutine expand(system, state, terms, series)
      type(system_type), intent(in) :: system
      !> Displacement and velocity of the base, then of each layer, shape (0:layers, 2)
      real(wp), intent(in), contiguous :: state(0:, :)
      !> Terms beyond the first
      integer, intent(in) :: terms
      !> Taylor coefficients of both, shape (0:layers, 2, 0:terms or more)
      real(wp), intent(inout), contiguous :: series(0:, :, 0:)

      real(wp) :: pull
      integer :: term

      series(:, :, 0) = state
      do term = 0, terms - 1
         pull = 0.0_wp
         if (term == 1) pull = system%spring * system%drive_velocity &
            & / system%layer_mass
         if (term == 2) pull = 0.5_wp * system%spring * system%drive_acceleration &
            & / system%layer_mass
         call accelerate(system, inverse(term + 1), pull, series(:, 1, term), &
            & series(:, 2, term), series(:, 2, term + 1))
         if (term == 0) call push(system, 0.0_wp, series(:, 2, 1))
         if (term == 1) call push_at_a_rate(system, series(:, 2, 2))
         series(:, 1, term + 1) = series(:, 2, term) * inverse(term + 1)
      end do
   end subroutine expand

   !> Values of many series at a time; four terms at once, to go through the values less often.
   pure subroutine sum_series(number, terms, series, time, values)
      !> Number of series, and of terms beyond the first
      integer, intent(in) :: number, terms
      real(wp), intent(in) :: series(number, 0:terms), time
      real(wp), intent(out) :: values(number)

      integer :: term

      values = series(:, terms)
      do term = terms - 1, 3, -4
         values = (((values * time + series(:, term)) * time + series(:, term - 1)) * time &
            & + series(:, term - 2)) * time + series(:, term - 3)
      end do
      do term = modulo(terms, 4) - 1, 0, -1
         values = values * time + series(:, term)
      end do
   end subroutine sum_series

end module mesoslip_sliders_layered_expansion
