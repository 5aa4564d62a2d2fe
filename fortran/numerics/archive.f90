!> The state of a run for a checkpoint: each object registers its own, by name.
!>
!> One procedure of an object both puts its state into an archive and takes it out, so that the two
!> cannot differ. Each entry has a name and a shape, which are checked when it is taken out: a state
!> of another kind, or of another version of the program, is an error and not a wrong result.
module mesoslip_numerics_archive
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid, status_memory
   use mesoslip_numerics_kinds, only: i8, wp
   implicit none
   private

   public :: archive_type

   !> Words of an entry's name, eight characters each, and of its heading: name, kind, shape
   integer, parameter :: name_words = 4, heading_words = name_words + 3
   integer, parameter :: name_length = 8 * name_words

   !> Words that are taken from an array, or put into one, at once
   integer(i8), parameter :: block = 1024_i8

   integer(i8), parameter :: kind_section = 0, kind_real = 1, kind_integer = 2

   !> A state as words of 64 bits, with a place where the next entry goes.
   type :: archive_type
      !> The words; those beyond length are not in use
      integer(i8), allocatable :: word(:)
      integer(i8) :: length = 0
      !> Whether values are put into the archive, rather than taken from it
      logical :: saving = .false.
      !> Set when an entry is not there, or there is not enough memory
      type(error_type), allocatable :: failure
      integer(i8), private :: place = 0
   contains
      procedure, non_overridable :: section
      !> Put a value into the archive, or take it out; an array takes the shape that it has there
      generic :: exchange => exchange_real, exchange_integer, exchange_long, exchange_logical, &
         & exchange_accumulator, exchange_reals, exchange_matrix, exchange_integers, &
         & exchange_integer_matrix
      procedure, non_overridable :: exchange_fixed
      procedure, non_overridable :: finish
      procedure, non_overridable, private :: exchange_real, exchange_integer, exchange_long, &
         & exchange_logical, exchange_accumulator, exchange_reals, exchange_matrix, &
         & exchange_integers, exchange_integer_matrix
      procedure, non_overridable, private :: heading, exchange_words, reserve
   end type archive_type

contains

   !> Begin the entries of an object; only one of the same kind can take them out.
   subroutine section(self, name)
      class(archive_type), intent(inout) :: self
      !> Kind of the object
      character(len=*), intent(in) :: name

      integer :: extent(2)

      extent = 0
      call self%heading(name, kind_section, extent)
   end subroutine section

   !> Make sure that all has been taken out.
   subroutine finish(self)
      class(archive_type), intent(inout) :: self

      if (allocated(self%failure) .or. self%saving) return
      if (self%place /= self%length) call raise(self%failure, status_invalid, &
         & "the checkpoint holds more than this version of the program keeps")
   end subroutine finish

   !> Name and shape of the next entry: put them in, or compare them.
   subroutine heading(self, name, kind, extent)
      class(archive_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer(i8), intent(in) :: kind
      !> Shape of the entry; that in the archive on return
      integer, intent(inout) :: extent(2)

      character(len=name_length) :: padded, found
      integer(i8) :: words(heading_words)

      if (allocated(self%failure)) return
      padded = name
      if (self%saving) then
         words(:name_words) = transfer(padded, words, name_words)
         words(name_words + 1:) = [kind, int(extent, i8)]
         call self%reserve(int(heading_words, i8))
         if (allocated(self%failure)) return
         self%word(self%place + 1:self%place + heading_words) = words
         self%place = self%place + heading_words
         self%length = self%place
         return
      end if
      if (self%place + heading_words > self%length) then
         call raise(self%failure, status_invalid, "the checkpoint ends before '" // name // "'")
         return
      end if
      words = self%word(self%place + 1:self%place + heading_words)
      self%place = self%place + heading_words
      found = transfer(words(:name_words), found)
      extent = int(words(name_words + 2:))
      if (found /= padded .or. words(name_words + 1) /= kind .or. any(extent < 0)) then
         call raise(self%failure, status_invalid, "the checkpoint has '" // trim(found) &
            & // "' where this version of the program has '" // name // "'")
      end if
   end subroutine heading

   subroutine exchange_words(self, words)
      class(archive_type), intent(inout) :: self
      integer(i8), intent(inout) :: words(:)

      integer(i8) :: length

      if (allocated(self%failure)) return
      length = size(words, kind=i8)
      if (self%saving) then
         call self%reserve(length)
         if (allocated(self%failure)) return
         self%word(self%place + 1:self%place + length) = words
         self%length = self%place + length
      else if (self%place + length <= self%length) then
         words = self%word(self%place + 1:self%place + length)
      else
         call raise(self%failure, status_invalid, "the checkpoint ends too early")
      end if
      self%place = self%place + length
   end subroutine exchange_words

   !> Exchange the numbers of an array of any shape.
   subroutine exchange_flat(self, length, value)
      type(archive_type), intent(inout) :: self
      integer(i8), intent(in) :: length
      real(wp), intent(inout) :: value(length)

      integer(i8) :: words(block), first, number

      do first = 1, length, block
         number = min(block, length - first + 1)
         words(:number) = transfer(value(first:first + number - 1), words, int(number))
         call self%exchange_words(words(:number))
         value(first:first + number - 1) = transfer(words(:number), value, int(number))
      end do
   end subroutine exchange_flat

   !> Make room for more words.
   subroutine reserve(self, more)
      class(archive_type), intent(inout) :: self
      integer(i8), intent(in) :: more

      integer(i8), parameter :: least = 1024_i8
      integer(i8), allocatable :: longer(:)
      integer :: stat

      stat = 0
      if (.not. allocated(self%word)) allocate (self%word(max(least, more)), stat=stat)
      if (stat == 0) then
         if (self%place + more <= size(self%word, kind=i8)) return
         allocate (longer(max(2_i8 * size(self%word, kind=i8), self%place + more)), stat=stat)
      end if
      if (stat /= 0) then
         call lack_memory(self)
         return
      end if
      longer(:self%place) = self%word(:self%place)
      call move_alloc(longer, self%word)
   end subroutine reserve

   subroutine lack_memory(self)
      class(archive_type), intent(inout) :: self

      call raise(self%failure, status_memory, "not enough memory for a checkpoint")
   end subroutine lack_memory

   subroutine exchange_real(self, name, value)
      class(archive_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(wp), intent(inout) :: value

      integer(i8) :: word(1)
      integer :: extent(2)

      extent = 1
      call self%heading(name, kind_real, extent)
      word = transfer(value, word)
      call self%exchange_words(word)
      value = transfer(word(1), value)
   end subroutine exchange_real

   subroutine exchange_long(self, name, value)
      class(archive_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer(i8), intent(inout) :: value

      integer(i8) :: word(1)
      integer :: extent(2)

      extent = 1
      call self%heading(name, kind_integer, extent)
      word = value
      call self%exchange_words(word)
      value = word(1)
   end subroutine exchange_long

   subroutine exchange_integer(self, name, value)
      class(archive_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer, intent(inout) :: value

      integer(i8) :: long

      long = int(value, i8)
      call self%exchange_long(name, long)
      value = int(long)
   end subroutine exchange_integer

   subroutine exchange_logical(self, name, value)
      class(archive_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      logical, intent(inout) :: value

      integer(i8) :: long

      long = merge(1_i8, 0_i8, value)
      call self%exchange_long(name, long)
      value = long /= 0_i8
   end subroutine exchange_logical

   subroutine exchange_accumulator(self, name, value)
      class(archive_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      type(accumulator_type), intent(inout) :: value

      call self%exchange_real(name, value%high)
      call self%exchange_real(name, value%low)
   end subroutine exchange_accumulator

   subroutine exchange_reals(self, name, value)
      class(archive_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(wp), intent(inout), allocatable :: value(:)

      integer :: extent(2), stat

      extent = 1
      if (self%saving) extent(1) = size(value)
      call self%heading(name, kind_real, extent)
      if (allocated(self%failure)) return
      if (.not. self%saving) then
         if (allocated(value)) deallocate (value)
         allocate (value(extent(1)), stat=stat)
         if (stat /= 0) then
            allocate (value(0))
            call lack_memory(self)
            return
         end if
      end if
      call exchange_flat(self, size(value, kind=i8), value)
   end subroutine exchange_reals

   subroutine exchange_matrix(self, name, value)
      class(archive_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(wp), intent(inout), allocatable :: value(:, :)

      integer :: extent(2), stat

      extent = 0
      if (self%saving) extent = shape(value)
      call self%heading(name, kind_real, extent)
      if (allocated(self%failure)) return
      if (.not. self%saving) then
         if (allocated(value)) deallocate (value)
         allocate (value(extent(1), extent(2)), stat=stat)
         if (stat /= 0) then
            allocate (value(0, 0))
            call lack_memory(self)
            return
         end if
      end if
      call exchange_flat(self, size(value, kind=i8), value)
   end subroutine exchange_matrix

   !> Exchange an array of any rank that keeps its shape and bounds.
   subroutine exchange_fixed(self, name, extent, value)
      class(archive_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      !> Shape of the array, as a matrix
      integer, intent(in) :: extent(2)
      real(wp), intent(inout) :: value(product(extent))

      integer :: found(2)

      found = extent
      call self%heading(name, kind_real, found)
      if (allocated(self%failure)) return
      if (any(found /= extent)) then
         call raise(self%failure, status_invalid, "the checkpoint has another size of '" &
            & // name // "'")
         return
      end if
      call exchange_flat(self, size(value, kind=i8), value)
   end subroutine exchange_fixed

   subroutine exchange_integers(self, name, value)
      class(archive_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer, intent(inout), allocatable :: value(:)

      integer :: extent(2), stat

      extent = 1
      if (self%saving) extent(1) = size(value)
      call self%heading(name, kind_integer, extent)
      if (allocated(self%failure)) return
      if (.not. self%saving) then
         if (allocated(value)) deallocate (value)
         allocate (value(extent(1)), stat=stat)
         if (stat /= 0) then
            allocate (value(0))
            call lack_memory(self)
            return
         end if
      end if
      call exchange_flat_integers(self, size(value, kind=i8), value)
   end subroutine exchange_integers

   subroutine exchange_integer_matrix(self, name, value)
      class(archive_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer, intent(inout), allocatable :: value(:, :)

      integer :: extent(2), length(2), stat

      extent = 0
      if (self%saving) extent = shape(value)
      call self%heading(name, kind_section, extent)
      length = [product(extent), 1]
      call self%heading(name, kind_integer, length)
      if (allocated(self%failure)) return
      if (length(1) /= product(extent)) then
         call raise(self%failure, status_invalid, "the checkpoint has another size of '" &
            & // name // "'")
         return
      end if
      if (.not. self%saving) then
         if (allocated(value)) deallocate (value)
         allocate (value(extent(1), extent(2)), stat=stat)
         if (stat /= 0) then
            allocate (value(0, 0))
            call lack_memory(self)
            return
         end if
      end if
      call exchange_flat_integers(self, size(value, kind=i8), value)
   end subroutine exchange_integer_matrix

   !> Exchange the integers of an array of any shape.
   subroutine exchange_flat_integers(self, length, value)
      type(archive_type), intent(inout) :: self
      integer(i8), intent(in) :: length
      integer, intent(inout) :: value(length)

      integer(i8) :: words(block), first, number

      do first = 1, length, block
         number = min(block, length - first + 1)
         words(:number) = int(value(first:first + number - 1), i8)
         call self%exchange_words(words(:number))
         if (.not. self%saving) value(first:first + number - 1) = int(words(:number))
      end do
   end subroutine exchange_flat_integers

end module mesoslip_numerics_archive
