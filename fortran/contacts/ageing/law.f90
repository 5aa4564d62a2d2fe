!> The law of ageing of a run, from its parameters.
module mesoslip_contacts_ageing_law
   use mesoslip_ageing_law, only: ageing_law_type, ageing_log, ageing_names, ageing_relax, old
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   implicit none
   private

   public :: ageing_law_type, take_ageing_law, ageing_relax, ageing_log, ageing_names, old

contains

   !> Take a law of ageing from named numbers.
   subroutine take_ageing_law(self, law, parameters, error)
      type(ageing_law_type), intent(out) :: self
      !> Law of the configured thresholds above the back force; on return only of those that are
      !> above it at birth, too
      class(threshold_law_type), intent(inout) :: law
      type(parameters_type), intent(inout) :: parameters
      !> Set if a number is missing or wrong, or no contact can attach
      type(error_type), allocatable, intent(inout) :: error

      real(wp) :: force_ratio, width, narrowing, minimum

      call parameters%take("ageing", ageing_names, self%kind, error)
      call parameters%take("ageing_time", self%time, error)
      call parameters%take("initial_age", self%initial_age, error)
      if (allocated(error)) return
      if (.not. (self%time > 0.0_wp .and. self%initial_age >= 0.0_wp)) then
         call raise(error, status_invalid, "the time of ageing must be positive, and no initial " &
            & // "age below 0")
         return
      end if
      self%inverse_time = 1.0_wp / self%time
      select case (self%kind)
      case (ageing_relax)
         call parameters%take("young_force_ratio", force_ratio, error)
         call parameters%take("young_relative_width", width, error)
         if (allocated(error)) return
         if (.not. (force_ratio > 0.0_wp .and. width > 0.0_wp)) then
            call raise(error, status_invalid, "force and width of the young must be positive")
            return
         end if
         narrowing = width / law%width
         self%mean_deficit = 1.0_wp - force_ratio
         self%width_deficit = 1.0_wp - force_ratio * narrowing
         minimum = (law%minimum - force_ratio * (1.0_wp - narrowing)) / (force_ratio * narrowing)
         if (minimum > law%minimum) call law%reject_below(minimum, error)
      case (ageing_log)
         call parameters%take("growth", self%growth, error)
         if (allocated(error)) return
         if (self%growth < 0.0_wp) then
            call raise(error, status_invalid, "the growth of thresholds must not be negative")
         end if
      case default
         call raise(error, status_invalid, "unknown law of ageing")
      end select
   end subroutine take_ageing_law

end module mesoslip_contacts_ageing_law
