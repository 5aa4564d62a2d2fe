!> Contacts in the order of a key, any of which may be removed at any time.
!>
!> The keys of all contacts are in one array. Those below a horizon are sorted; when they are used
!> up, all keys are scanned for the next ones. The number of these grows with that of all contacts,
!> so that the cost of a contact does not. A removed contact is noticed at its turn, when its key
!> has changed.
module mesoslip_contacts_individual_scan_order
   use mesoslip_contacts_individual_sorting, only: before, push, remove_first, sort
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: scan_order_type, new_scan_order

   !> Key of a contact that is not in the order
   real(wp), parameter :: none = huge(1.0_wp)
   !> Contacts wanted of the first scan; doubled in each scan up to this part of all contacts, 1/4
   integer, parameter :: min_scan = 64, part = 4
   !> Room for late contacts before the sorted ones, and the maximum number of sorted ones that
   !> move to make room again
   integer, parameter :: slack = 64, max_moved = 4096
   !> Late contacts beyond this part of all, 1/16, cause a new scan
   integer, parameter :: late_part = 16
   !> Bins in which contacts are sorted: their maximum number, mean and maximum contacts in one
   integer, parameter :: max_bins = 4096, bin_load = 2, max_load = 64
   !> Keys that are sampled to estimate a horizon
   integer, parameter :: samples = 64
   !> Contacts wanted over those found from which that is done again
   integer, parameter :: max_lack = 4
   !> Maximum factor by which the distance to the next horizon changes
   real(wp), parameter :: max_factor = 4.0_wp

   !> Contacts in the order of their keys, then of their numbers.
   type :: scan_order_type
      private
      !> Key of each contact, shape (capacity)
      real(wp), allocatable :: key(:)
      !> Horizon: contacts with keys below are sorted, or late; distance to the next horizon
      real(wp) :: horizon = -none, reach = 0.0_wp
      !> Number of contacts wanted of a scan
      integer :: wanted = min_scan
      !> The remaining sorted contacts
      integer :: next = 1, last = 0
      real(wp), allocatable :: near_key(:)
      integer, allocatable :: near_contact(:)
      !> A heap of late contacts, inserted after the scan
      integer :: late_count = 0
      real(wp), allocatable :: late_key(:)
      integer, allocatable :: late_contact(:)
   contains
      !> Insert or change a contact, remove one, remove all
      procedure, non_overridable :: put, remove, clear
      !> The lowest key: by one pass over all keys, or by their order
      procedure, non_overridable :: lowest, first
      !> The first contact if its key has been reached, and the first contacts in their order
      procedure, non_overridable :: due, preview
      !> Discard the order of the next contacts, so that insertion is cheaper
      procedure, non_overridable :: rest
      procedure, non_overridable, private :: find_next, scan, estimate_reach, absorb
   end type scan_order_type

contains

   !> Set up without contacts.
   subroutine new_scan_order(self, capacity, error)
      type(scan_order_type), intent(out) :: self
      !> Number of contacts
      integer, intent(in) :: capacity
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      integer :: stat

      ! A scan writes one entry beyond those that it counts.
      allocate (self%key(capacity), stat=stat)
      if (stat == 0) allocate (self%near_key(slack + capacity + 1), stat=stat)
      if (stat == 0) allocate (self%near_contact(slack + capacity + 1), stat=stat)
      if (stat == 0) allocate (self%late_key(capacity), stat=stat)
      if (stat == 0) allocate (self%late_contact(capacity), stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the order of breaking")
         return
      end if
      call self%clear()
   end subroutine new_scan_order

   !> Remove all contacts.
   pure subroutine clear(self)
      class(scan_order_type), intent(inout) :: self

      self%key = none
      call self%rest()
   end subroutine clear

   !> Discard the order of the next contacts, so that insertion is cheaper.
   pure subroutine rest(self)
      class(scan_order_type), intent(inout) :: self

      self%horizon = -none
      self%reach = 0.0_wp
      self%wanted = min_scan
      self%next = 1
      self%last = 0
      self%late_count = 0
   end subroutine rest

   !> The lowest key, by one pass over all keys; huge without contacts.
   pure function lowest(self) result(key)
      class(scan_order_type), intent(in) :: self
      real(wp) :: key

      real(wp) :: least(4)
      integer :: position

      ! Four independent minima at a time.
      least = none
      do position = 1, size(self%key) - 3, 4
         least = min(least, self%key(position:position + 3))
      end do
      key = minval(least)
      do position = 4 * (size(self%key) / 4) + 1, size(self%key)
         key = min(key, self%key(position))
      end do
   end function lowest

   !> Insert a contact, or change its key.
   pure subroutine put(self, contact, key)
      class(scan_order_type), intent(inout) :: self
      integer, intent(in) :: contact
      real(wp), intent(in) :: key

      self%key(contact) = key
      if (.not. key < self%horizon) return
      if (self%late_count == size(self%late_key)) then
         ! Most of them have been removed since.
         call self%rest()
         return
      end if
      self%late_count = self%late_count + 1
      call push(self%late_key, self%late_contact, self%late_count, key, contact)
   end subroutine put

   !> Remove a contact.
   pure subroutine remove(self, contact)
      class(scan_order_type), intent(inout) :: self
      integer, intent(in) :: contact

      self%key(contact) = none
   end subroutine remove

   !> The lowest key, by the order of the next contacts; huge without contacts.
   pure subroutine first(self, key)
      class(scan_order_type), intent(inout) :: self
      real(wp), intent(out) :: key

      logical :: is_late

      call self%find_next(is_late)
      key = none
      if (is_late) then
         key = self%late_key(1)
      else if (self%next <= self%last) then
         key = self%near_key(self%next)
      end if
   end subroutine first

   !> The first contact if its key has been reached.
   pure subroutine due(self, reading, contact)
      class(scan_order_type), intent(inout) :: self
      !> Reading up to which keys have been reached
      real(wp), intent(in) :: reading
      !> Number of the contact, which is not removed; 0 if no contact is due
      integer, intent(out) :: contact

      logical :: is_late

      contact = 0
      call self%find_next(is_late)
      if (is_late) then
         if (self%late_key(1) <= reading) contact = self%late_contact(1)
      else if (self%next <= self%last) then
         if (self%near_key(self%next) <= reading) contact = self%near_contact(self%next)
      end if
   end subroutine due

   !> Find the next contact.
   pure subroutine find_next(self, is_late)
      class(scan_order_type), intent(inout) :: self
      !> Whether it is the first late contact; otherwise it is the first sorted one, if any
      logical, intent(out) :: is_late

      do
         do while (self%next <= self%last)
            if (.not. abs(self%near_key(self%next) &
               & - self%key(self%near_contact(self%next))) > 0.0_wp) exit
            self%next = self%next + 1
         end do
         do while (self%late_count > 0)
            if (.not. abs(self%late_key(1) - self%key(self%late_contact(1))) > 0.0_wp) exit
            call drop_late(self)
         end do
         if (self%next <= self%last .or. self%late_count > 0 .or. self%horizon >= none) exit
         call self%scan()
      end do
      is_late = self%late_count > 0
      if (is_late .and. self%next <= self%last) then
         is_late = before(self%late_key(1), self%late_contact(1), self%near_key(self%next), &
            & self%near_contact(self%next))
      end if
   end subroutine find_next

   !> Drop the first late contact.
   pure subroutine drop_late(self)
      class(scan_order_type), intent(inout) :: self

      call remove_first(self%late_key, self%late_contact, self%late_count)
      self%late_count = self%late_count - 1
   end subroutine drop_late

   !> Sort the contacts up to the next horizon; there are no contacts below the present one.
   pure subroutine scan(self)
      class(scan_order_type), intent(inout) :: self

      real(wp) :: start, horizon
      integer :: last

      start = self%horizon
      if (.not. (start > -none .and. self%reach > 0.0_wp)) then
         start = self%lowest()
         call self%estimate_reach(start)
      end if
      horizon = none
      if (self%reach < none - start) horizon = max(start + self%reach, nearest(start, 1.0_wp))
      last = slack
      call collect(self%key, horizon, self%near_key, self%near_contact, last)
      self%horizon = horizon
      self%next = slack + 1
      self%last = last
      call sort_evenly(self%near_key(slack + 1:last), self%near_contact(slack + 1:last), start, &
         & horizon)
      ! A distance that is far too small is estimated again: a factor would follow too slowly.
      if (last - slack < self%wanted / max_lack) self%reach = 0.0_wp
      if (self%reach < none / max_factor &
         & .and. (last - slack < self%wanted / 2 .or. last - slack > 2 * self%wanted)) then
         self%reach = self%reach * min(max_factor, max(1.0_wp / max_factor, &
            & real(self%wanted, wp) / max(1, last - slack)))
      end if
      if (2 * part * self%wanted <= size(self%key)) then
         self%wanted = 2 * self%wanted
         if (self%reach < none / max_factor) self%reach = 2.0_wp * self%reach
      end if
   end subroutine scan

   !> Append the contacts with keys below a horizon to a list. Without a branch: each is written,
   !> and counted if it is below.
   pure subroutine collect(key, horizon, near_key, near_contact, last)
      real(wp), intent(in), contiguous :: key(:)
      real(wp), intent(in) :: horizon
      !> The list, and its last entry
      real(wp), intent(inout), contiguous :: near_key(:)
      integer, intent(inout), contiguous :: near_contact(:)
      integer, intent(inout) :: last

      integer :: contact, entry

      entry = last
      do contact = 1, size(key)
         near_key(entry + 1) = key(contact)
         near_contact(entry + 1) = contact
         entry = entry + merge(1, 0, key(contact) < horizon)
      end do
      last = entry
   end subroutine collect

   !> Sort contacts by key, then by number; the keys are nearly uniform between two values.
   pure subroutine sort_evenly(key, contact, start, horizon)
      real(wp), intent(inout), contiguous :: key(:)
      integer, intent(inout), contiguous :: contact(:)
      !> The two values
      real(wp), intent(in) :: start, horizon

      integer, allocatable :: bin(:), last_contact(:)
      real(wp), allocatable :: last_key(:)
      integer :: filled(0:max_bins), bins, position, place, stat
      real(wp) :: scale

      bins = min(max_bins, size(key) / bin_load)
      if (bins < 2 .or. .not. horizon < none) then
         call sort(key, contact, size(key))
         return
      end if
      allocate (bin(size(key)), stat=stat)
      if (stat == 0) allocate (last_contact(size(key)), stat=stat)
      if (stat == 0) allocate (last_key(size(key)), stat=stat)
      if (stat /= 0) then
         call sort(key, contact, size(key))
         return
      end if
      filled(:bins) = 0
      scale = bins / (horizon - start)
      do position = 1, size(key)
         bin(position) = min(bins, 1 + int((key(position) - start) * scale))
      end do
      do position = 1, size(key)
         filled(bin(position)) = filled(bin(position)) + 1
      end do
      if (maxval(filled(:bins)) > max_load) then
         call sort(key, contact, size(key))
         return
      end if
      do position = 1, bins
         filled(position) = filled(position) + filled(position - 1)
      end do
      do position = size(key), 1, -1
         place = filled(bin(position))
         filled(bin(position)) = place - 1
         last_key(place) = key(position)
         last_contact(place) = contact(position)
      end do
      do position = 1, size(key)
         place = position
         do while (place > 1)
            if (.not. before(last_key(position), last_contact(position), key(place - 1), &
               & contact(place - 1))) exit
            key(place) = key(place - 1)
            contact(place) = contact(place - 1)
            place = place - 1
         end do
         key(place) = last_key(position)
         contact(place) = last_contact(position)
      end do
   end subroutine sort_evenly

   !> Estimate the distance to a horizon with the wanted number of contacts below.
   pure subroutine estimate_reach(self, start)
      class(scan_order_type), intent(inout) :: self
      !> The lowest key
      real(wp), intent(in) :: start

      real(wp) :: sample(samples)
      integer :: number(samples), position, rank

      do position = 1, samples
         number(position) = 1 + int(real(position - 1, wp) * size(self%key) / samples)
         sample(position) = self%key(number(position))
      end do
      call sort(sample, number, samples)
      rank = max(1, min(samples, nint(real(samples, wp) * self%wanted / size(self%key))))
      self%reach = none
      if (sample(rank) < none) self%reach = 2.0_wp * (sample(rank) - start)
      if (.not. self%reach > 0.0_wp) self%reach = none
   end subroutine estimate_reach

   !> Merge the late contacts into the first sorted ones.
   pure subroutine absorb(self, limit)
      class(scan_order_type), intent(inout) :: self
      !> Number of these sorted ones
      integer, intent(in) :: limit

      integer :: position, contact
      real(wp) :: key
      logical :: is_late

      if (self%late_count > max(slack, size(self%key) / late_part)) call self%rest()
      do
         call self%find_next(is_late)
         if (self%late_count == 0) return
         if (self%next == 1) call make_room(self)
         if (self%next == 1) return
         key = self%late_key(1)
         contact = self%late_contact(1)
         if (self%next <= self%last) then
            position = min(self%next + limit - 1, self%last)
            if (.not. before(key, contact, self%near_key(position), &
               & self%near_contact(position))) then
               return
            end if
         end if
         call drop_late(self)
         if (abs(key - self%key(contact)) > 0.0_wp) cycle
         position = self%next - 1
         do while (position < self%last)
            if (before(key, contact, self%near_key(position + 1), &
               & self%near_contact(position + 1))) exit
            self%near_key(position) = self%near_key(position + 1)
            self%near_contact(position) = self%near_contact(position + 1)
            position = position + 1
         end do
         self%near_key(position) = key
         self%near_contact(position) = contact
         self%next = self%next - 1
      end do
   end subroutine absorb

   !> Make room before the sorted contacts, unless they are too many.
   pure subroutine make_room(self)
      class(scan_order_type), intent(inout) :: self

      if (self%last > max_moved .or. self%last + slack > size(self%near_key)) return
      self%near_key(slack + 1:slack + self%last) = self%near_key(:self%last)
      self%near_contact(slack + 1:slack + self%last) = self%near_contact(:self%last)
      self%next = slack + 1
      self%last = slack + self%last
   end subroutine make_room

   !> The first contacts in their order; no other contact has the key of one of them.
   pure subroutine preview(self, limit, contact, key, number)
      class(scan_order_type), intent(inout) :: self
      !> Maximum number
      integer, intent(in) :: limit
      !> Contacts and their keys
      integer, intent(out) :: contact(:)
      real(wp), intent(out) :: key(:)
      !> Their number; may be 0 although there are contacts
      integer, intent(out) :: number

      real(wp) :: beyond
      integer :: position

      call self%absorb(limit)
      number = 0
      beyond = none
      if (self%late_count > 0) beyond = self%late_key(1)
      do position = self%next, self%last
         associate (one => self%near_contact(position))
            if (abs(self%near_key(position) - self%key(one)) > 0.0_wp) cycle
            ! A contact that was removed and inserted again with the same key is there twice.
            if (number > 0) then
               if (contact(number) == one) cycle
            end if
            if (number == limit) then
               beyond = min(beyond, self%near_key(position))
               exit
            end if
            number = number + 1
            contact(number) = one
            key(number) = self%near_key(position)
         end associate
      end do
      do while (number > 0)
         if (key(number) < beyond) exit
         number = number - 1
      end do
   end subroutine preview

end module mesoslip_contacts_individual_scan_order
