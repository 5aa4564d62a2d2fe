!> Named parameters, numbers or words, from which kinds of sliders and contacts are made.
!>
!> Each kind takes its parameters by name. A missing name is an error, and so is one that is not
!> taken: a misspelt or superfluous parameter is found at once. A list of numbers is a name that
!> occurs several times.
module mesoslip_numerics_parameters
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: parameters_type, new_parameters, choose
   public :: name_length

   !> Characters of a name, and of a word
   integer, parameter :: name_length = 32

   !> Numbers and words by name.
   type :: parameters_type
      private
      character(len=name_length), allocatable :: name(:)
      real(wp), allocatable :: value(:)
      !> Words; blank for a number
      character(len=name_length), allocatable :: word(:)
      logical, allocatable :: is_taken(:)
   contains
      !> Take the parameter of a name: a number, a word, or a word that is one of some choices
      generic :: take => take_real, take_integer, take_logical, take_word, take_choice, take_list
      procedure, non_overridable :: has
      procedure, non_overridable :: add_word
      procedure, non_overridable :: finish
      procedure, non_overridable, private :: take_real, take_integer, take_logical, take_word, &
         & take_choice, take_list, find
   end type parameters_type

contains

   !> Set up a table.
   pure subroutine new_parameters(self, name, value, word)
      type(parameters_type), intent(out) :: self
      !> Names and values, shape (parameters)
      character(len=*), intent(in) :: name(:)
      real(wp), intent(in) :: value(:)
      !> Words, shape (parameters); blank for a number, by default all
      character(len=*), intent(in), optional :: word(:)

      self%name = name
      self%value = value
      allocate (self%word(size(name)))
      self%word = ""
      if (present(word)) self%word = word
      allocate (self%is_taken(size(name)), source=.false.)
   end subroutine new_parameters

   !> Whether there is a parameter of a name.
   pure function has(self, name)
      class(parameters_type), intent(in) :: self
      character(len=*), intent(in) :: name
      logical :: has

      has = any(self%name == name)
   end function has

   !> Add a word.
   pure subroutine add_word(self, name, word)
      class(parameters_type), intent(inout) :: self
      character(len=*), intent(in) :: name, word

      self%name = [character(len=name_length) :: self%name, name]
      self%value = [self%value, 0.0_wp]
      self%word = [character(len=name_length) :: self%word, word]
      self%is_taken = [self%is_taken, .false.]
   end subroutine add_word

   !> The place of a name in the table, which is marked as taken; 0 if it is missing.
   subroutine find(self, name, place, error)
      class(parameters_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer, intent(out) :: place
      type(error_type), allocatable, intent(inout) :: error

      integer :: parameter_place

      place = 0
      if (allocated(error)) return
      do parameter_place = 1, size(self%name)
         if (self%name(parameter_place) == name) place = parameter_place
      end do
      if (place == 0) then
         call raise(error, status_invalid, "parameter '" // name // "' is missing")
         return
      end if
      self%is_taken(place) = .true.
   end subroutine find

   subroutine take_real(self, name, value, error)
      class(parameters_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(wp), intent(out) :: value
      type(error_type), allocatable, intent(inout) :: error

      integer :: place

      value = 0.0_wp
      call self%find(name, place, error)
      if (allocated(error)) return
      value = self%value(place)
      if (self%word(place) == "") return
      call raise(error, status_invalid, "parameter '" // name // "' must be a number, not '" &
         & // trim(self%word(place)) // "'")
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

   subroutine take_word(self, name, word, error)
      class(parameters_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      character(len=name_length), intent(out) :: word
      type(error_type), allocatable, intent(inout) :: error

      integer :: place

      word = ""
      call self%find(name, place, error)
      if (.not. allocated(error)) word = self%word(place)
   end subroutine take_word

   !> Take a word as its position among some choices.
   subroutine take_choice(self, name, choices, position, error)
      class(parameters_type), intent(inout) :: self
      character(len=*), intent(in) :: name, choices(:)
      integer, intent(out) :: position
      type(error_type), allocatable, intent(inout) :: error

      integer :: place

      position = 0
      call self%find(name, place, error)
      if (allocated(error)) return
      call choose(name, self%word(place), choices, position, error)
   end subroutine take_choice

   !> Take all numbers of a name, in their order.
   subroutine take_list(self, name, values, error)
      class(parameters_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(wp), allocatable, intent(out) :: values(:)
      type(error_type), allocatable, intent(inout) :: error

      logical, allocatable :: is_meant(:)
      integer :: place

      call self%find(name, place, error)
      if (allocated(error)) return
      is_meant = self%name == name
      values = pack(self%value, is_meant)
      where (is_meant) self%is_taken = .true.
   end subroutine take_list

   !> Make sure that each parameter was taken.
   subroutine finish(self, error)
      class(parameters_type), intent(in) :: self
      !> Set if one was not
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

   !> The position of a word among some choices.
   subroutine choose(name, word, choices, position, error)
      !> Name of the choice, for the error
      character(len=*), intent(in) :: name
      character(len=*), intent(in) :: word, choices(:)
      !> Position from 1; 0 if the word is not one of them
      integer, intent(out) :: position
      !> Set if it is not one of them
      type(error_type), allocatable, intent(inout) :: error

      integer :: candidate

      position = 0
      do candidate = 1, size(choices)
         if (word == choices(candidate)) position = candidate
      end do
      if (position == 0) call raise(error, status_invalid, "unknown " // name // " '" &
         & // trim(word) // "'")
   end subroutine choose

end module mesoslip_numerics_parameters
