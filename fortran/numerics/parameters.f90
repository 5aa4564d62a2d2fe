!> Named numbers that a kind of slider or of contacts is made from.
!>
!> Whoever is made takes what it needs by name. A name that is missing, or that nobody has taken, is
!> an error: so a misspelt or superfluous parameter is found at once.
module mesoslip_numerics_parameters
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: parameters_type, new_parameters
   public :: name_length

   !> Characters of a name
   integer, parameter :: name_length = 32

   !> Numbers by name.
   type :: parameters_type
      private
      character(len=name_length), allocatable :: name(:)
      real(wp), allocatable :: value(:)
      logical, allocatable :: is_taken(:)
   contains
      !> Take the number of a name
      generic :: take => take_real, take_integer, take_logical
      !> Make sure that each number was taken
      procedure, non_overridable :: finish
      procedure, non_overridable, private :: take_real, take_integer, take_logical
   end type parameters_type

contains

   !> Set up a table.
   subroutine new_parameters(self, name, value)
      !> The table
      type(parameters_type), intent(out) :: self
      !> Names, shape (number)
      character(len=*), intent(in) :: name(:)
      !> Their values, shape (number)
      real(wp), intent(in) :: value(:)

      self%name = name
      self%value = value
      allocate (self%is_taken(size(name)), source=.false.)
   end subroutine new_parameters

   subroutine take_real(self, name, value, error)
      class(parameters_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(wp), intent(out) :: value
      type(error_type), allocatable, intent(inout) :: error

      integer :: place

      value = 0.0_wp
      if (allocated(error)) return
      do place = 1, size(self%name)
         if (self%name(place) == name) then
            value = self%value(place)
            self%is_taken(place) = .true.
            return
         end if
      end do
      call raise(error, status_invalid, "parameter '" // name // "' is missing")
   end subroutine take_real

   subroutine take_integer(self, name, value, error)
      class(parameters_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer, intent(out) :: value
      type(error_type), allocatable, intent(inout) :: error

      real(wp) :: number

      value = 0
      call self%take_real(name, number, error)
      if (allocated(error)) return
      if (abs(number) > real(huge(value), wp) .or. abs(number - anint(number)) > 0.0_wp) then
         call raise(error, status_invalid, "parameter '" // name // "' must be a whole number")
         return
      end if
      value = nint(number)
   end subroutine take_integer

   subroutine take_logical(self, name, value, error)
      class(parameters_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      logical, intent(out) :: value
      type(error_type), allocatable, intent(inout) :: error

      integer :: number

      call self%take_integer(name, number, error)
      value = number /= 0
   end subroutine take_logical

   !> Make sure that each number was taken.
   subroutine finish(self, error)
      !> The table
      class(parameters_type), intent(in) :: self
      !> Set if nobody has asked for one of its names
      type(error_type), allocatable, intent(inout) :: error

      integer :: place

      if (allocated(error)) return
      do place = 1, size(self%name)
         if (.not. self%is_taken(place)) then
            call raise(error, status_invalid, "unknown parameter '" // trim(self%name(place)) &
               & // "'")
            return
         end if
      end do
   end subroutine finish

end module mesoslip_numerics_parameters
