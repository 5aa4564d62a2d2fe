!> The contacts of an avalanche on a lattice: their order of breaking, and their extent.
module mesoslip_contacts_individual_avalanche_track
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   implicit none
   private

   public :: avalanche_track_type, new_avalanche_track
   public :: track_length, row_generation, row_member

   !> Numbers kept for a contact
   integer, parameter :: track_length = 2
   !> Generation in which the contact broke in the current avalanche, from 1; 0 if it did not
   integer, parameter :: row_generation = 1
   !> List of the contacts of the avalanche in the order of breaking; not by contact
   integer, parameter :: row_member = 2

   !> Up to this number of contacts their columns and rows are sorted, beyond it marked
   integer, parameter :: few = 12

   !> The contacts of the current avalanche.
   type :: avalanche_track_type
      !> Columns and rows of the lattice; 0 columns without a lattice
      integer :: columns = 0, rows = 0
      !> Number of contacts that broke, each counted once
      integer :: area = 0
      !> Number of generations that have broken; contacts that break belong to the next one
      integer :: generation = 0
      !> State of the track, shape (track_length, columns rows)
      integer, allocatable :: contact(:, :)
   contains
      !> Add a contact that breaks, clear the avalanche
      procedure, non_overridable :: add, clear
      !> Columns and rows of the smallest rectangle around the avalanche
      procedure, non_overridable :: extent
      !> Write the state to an archive, or read it
      procedure, non_overridable :: exchange
   end type avalanche_track_type

contains

   !> Set up a track without an avalanche.
   subroutine new_avalanche_track(self, columns, rows, error)
      type(avalanche_track_type), intent(out) :: self
      !> Columns and rows of the lattice; 0 columns without a lattice
      integer, intent(in) :: columns, rows
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(out) :: error

      integer :: stat

      self%columns = columns
      self%rows = rows
      allocate (self%contact(track_length, columns * rows), stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the avalanches of contacts")
         return
      end if
      self%contact = 0
   end subroutine new_avalanche_track

   !> Add a contact that breaks; one that breaks again in an avalanche keeps its generation.
   pure subroutine add(self, contact)
      class(avalanche_track_type), intent(inout) :: self
      integer, intent(in) :: contact

      if (self%columns == 0) return
      if (self%contact(row_generation, contact) > 0) return
      self%contact(row_generation, contact) = self%generation + 1
      self%area = self%area + 1
      self%contact(row_member, self%area) = contact
   end subroutine add

   !> Columns and rows of the smallest rectangle around the avalanche, on a lattice without edges.
   pure subroutine extent(self, width, height)
      class(avalanche_track_type), intent(in) :: self
      !> Numbers of columns and rows
      integer, intent(out) :: width, height

      width = min(self%area, 1)
      height = width
      if (self%area < 2) return
      width = arc(self, self%columns, 1)
      height = arc(self, self%rows, self%columns)
   end subroutine extent

   !> Length of the shortest arc of a circle of columns or rows that contains those of an avalanche.
   pure function arc(self, length, stride)
      type(avalanche_track_type), intent(in) :: self
      !> Length of the circle, and distance of its sites in the numbers of contacts
      integer, intent(in) :: length, stride
      integer :: arc

      logical :: marked(0:length - 1)
      integer :: sorted(few), number, position, gap, previous, first, site

      gap = 0
      marked = .false.
      if (self%area <= few) then
         do number = 1, self%area
            site = modulo((self%contact(row_member, number) - 1) / stride, length)
            do position = number, 2, -1
               if (sorted(position - 1) <= site) exit
               sorted(position) = sorted(position - 1)
            end do
            sorted(position) = site
         end do
         previous = sorted(self%area) - length
         do number = 1, self%area
            gap = max(gap, sorted(number) - previous - 1)
            previous = sorted(number)
         end do
      else
         do number = 1, self%area
            marked(modulo((self%contact(row_member, number) - 1) / stride, length)) = .true.
         end do
         first = findloc(marked, .true., dim=1) - 1
         previous = first
         do position = first + 1, length - 1
            if (.not. marked(position)) cycle
            gap = max(gap, position - previous - 1)
            previous = position
         end do
         gap = max(gap, first + length - previous - 1)
      end if
      arc = length - gap
   end function arc

   !> Clear the avalanche.
   pure subroutine clear(self)
      class(avalanche_track_type), intent(inout) :: self

      integer :: site

      do site = 1, self%area
         self%contact(row_generation, self%contact(row_member, site)) = 0
      end do
      self%area = 0
      self%generation = 0
   end subroutine clear

   !> Write the state to an archive, or read it.
   subroutine exchange(self, archive)
      class(avalanche_track_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%exchange("area", self%area)
      call archive%exchange("generation", self%generation)
      call archive%exchange("track", self%contact)
   end subroutine exchange

end module mesoslip_contacts_individual_avalanche_track
