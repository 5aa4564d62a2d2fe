!> The threshold laws by name: the only place that knows them all.
module mesoslip_contacts_threshold_laws
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   use mesoslip_contacts_threshold_laws_exponential, only: exponential_law_type
   use mesoslip_contacts_threshold_laws_gaussian, only: gaussian_law_type
   use mesoslip_contacts_threshold_laws_lognormal, only: lognormal_law_type
   use mesoslip_contacts_threshold_laws_uniform, only: uniform_law_type
   use mesoslip_contacts_threshold_laws_weibull, only: weibull_law_type
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: new_parameters, parameters_type
   implicit none
   private

   public :: make_threshold_law, new_threshold_law, law_names

   !> Names of the laws
   character(len=11), parameter :: law_names(5) = [character(len=11) :: "gaussian", "uniform", &
      & "lognormal", "weibull", "exponential"]

contains

   !> Set up a law from named values.
   subroutine make_threshold_law(law, name, parameters, minimum, error)
      !> The law
      class(threshold_law_type), allocatable, intent(out) :: law
      !> Its name
      character(len=*), intent(in) :: name
      !> What it is made of
      type(parameters_type), intent(inout) :: parameters
      !> Thresholds at or below are rejected; not negative
      real(wp), intent(in) :: minimum
      !> Set if there is no such law, a value is missing, or no threshold is left
      type(error_type), allocatable, intent(inout) :: error

      if (allocated(error)) return
      select case (name)
      case ("exponential")
         allocate (exponential_law_type :: law)
      case ("gaussian")
         allocate (gaussian_law_type :: law)
      case ("lognormal")
         allocate (lognormal_law_type :: law)
      case ("uniform")
         allocate (uniform_law_type :: law)
      case ("weibull")
         allocate (weibull_law_type :: law)
      case default
         call raise(error, status_invalid, "unknown threshold law '" // trim(name) // "'")
         return
      end select
      call law%take(parameters, error)
      if (.not. allocated(error)) call law%reject_below(minimum, error)
   end subroutine make_threshold_law

   !> Set up a law that is made of its width.
   subroutine new_threshold_law(law, name, width, minimum, error)
      !> The law
      class(threshold_law_type), allocatable, intent(out) :: law
      !> Its name
      character(len=*), intent(in) :: name
      !> Standard deviation over mean, positive
      real(wp), intent(in) :: width
      !> Thresholds at or below are rejected; not negative
      real(wp), intent(in) :: minimum
      !> Set if the law does not exist
      type(error_type), allocatable, intent(out) :: error

      type(parameters_type) :: parameters

      call new_parameters(parameters, ["relative_width"], [width])
      call make_threshold_law(law, name, parameters, minimum, error)
   end subroutine new_threshold_law

end module mesoslip_contacts_threshold_laws
