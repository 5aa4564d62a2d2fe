!> Detached contacts of infinitely many: packets of them, in the order in which they broke.
!>
!> A packet broke within one step, at a rate that is linear in time, and attaches likewise, after
!> the delay. A constant rate would shorten the delays of breaks that become more frequent, an error
!> that grows with an instability. With exponential delays there are no packets: detached contacts
!> attach at a constant rate.
module mesoslip_contacts_populations_packets
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_contacts_base, only: contact_parameters_type
   use mesoslip_contacts_mechanics, only: delay_exponential
   use mesoslip_contacts_populations_motion, only: distance_in, max_time, patience, position_at, &
      & time_after
   use mesoslip_contacts_populations_waiting, only: mean_attached_time, mean_own_time, &
      & attached_part, own_attached_part
   use mesoslip_interface_law, only: pose_type
   implicit none
   private

   public :: detached_packets_type, expected_births_type, new_detached_packets

   !> Numbers of a packet: start and end of its breaks [s], number of contacts, their mass, and the
   !> growth of the rate of breaks: half its change in this time, over its mean
   integer, parameter :: packet_length = 5
   integer, parameter :: row_start = 1, row_end = 2, row_number = 3, row_mass = 4, row_growth = 5

   !> Part of the contacts that is too small for a packet of its own
   real(wp), parameter :: negligible_part = 1.0e-10_wp
   !> Rate of breaks over that of those before, up to which it is about the same
   real(wp), parameter :: max_rate_ratio = 8.0_wp
   !> Packets for which there is room at first
   integer, parameter :: initial_packets = 64

   !> Contacts expected to attach in a step.
   type :: expected_births_type
      !> Number of contacts that are detached before the step, their mass, and the sum of the times
      !> until they attach [s]
      real(wp) :: number = 0.0_wp, mass = 0.0_wp, wait = 0.0_wp
      !> Number of contacts that also break in the step, their mass, and the sum of the parts of its
      !> displacement at which they attach
      real(wp) :: own = 0.0_wp, own_mass = 0.0_wp, own_place = 0.0_wp
      !> Latest end of the step for them [s]
      real(wp) :: end_time = huge(1.0_wp)
   end type expected_births_type

   !> Packets of detached contacts.
   type :: detached_packets_type
      !> Number and mass of the detached contacts
      type(accumulator_type) :: number, mass
      !> Part of a step without attachments between packets that does not end it
      real(wp) :: short_gap = 0.0_wp

      !> Time between breaking and attaching [s], and whether contacts attach again
      real(wp), private :: delay = 0.0_wp
      logical, private :: reattach = .true.
      !> Number of contacts that is too small for a packet of its own
      real(wp), private :: negligible = 0.0_wp
      !> First and last packet, and how much of the time of the first is over
      integer, private :: first = 1, last = 0
      real(wp), private :: first_part = 0.0_wp
      !> Contacts that are too few for a packet of their own, and join the next
      real(wp), private :: pending(packet_length) = 0.0_wp
      !> Whether delays are exponential, and then number and mass of the breaks in the last step
      logical, private :: is_random = .false.
      real(wp), private :: fresh(2) = 0.0_wp
      !> The packets, shape (packet_length, packets)
      real(wp), allocatable, private :: packet(:, :)
      !> Under a changing load, by the heights of sites: numbers of all detached contacts, of those
      !> that are pending, and of the breaks in the last step, shape (bins); parts of the packets,
      !> shape (bins, packets)
      real(wp), allocatable, private :: held(:), pending_held(:), fresh_held(:), mix(:, :)
   contains
      procedure, non_overridable :: add, is_empty, expect, shorten_step, own_part, own_place, &
         & take_due, set_bins, keep, exchange
      procedure, non_overridable, private :: due_times, continues, make_room, expect_random, &
         & take_random, remove_empty
   end type detached_packets_type

contains

   !> Set up packets without contacts.
   subroutine new_detached_packets(self, parameters)
      type(detached_packets_type), intent(out) :: self
      type(contact_parameters_type), intent(in) :: parameters

      self%delay = parameters%delay
      self%reattach = parameters%reattach
      self%is_random = parameters%delay_law == delay_exponential
      self%negligible = negligible_part * parameters%count
      allocate (self%packet(packet_length, initial_packets), source=0.0_wp)
   end subroutine new_detached_packets

   !> Keep contacts by the heights of their sites, in a number of bins.
   subroutine set_bins(self, bins, error)
      class(detached_packets_type), intent(inout) :: self
      integer, intent(in) :: bins
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      integer :: stat

      allocate (self%held(bins), source=0.0_wp, stat=stat)
      if (stat == 0) allocate (self%pending_held(bins), source=0.0_wp, stat=stat)
      if (stat == 0) allocate (self%fresh_held(bins), source=0.0_wp, stat=stat)
      if (stat == 0) allocate (self%mix(bins, size(self%packet, 2)), source=0.0_wp, stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the detached contacts")
      end if
   end subroutine set_bins

   !> Add contacts that broke from one time to another [s], their mass, and the growth of their
   !> rate.
   subroutine add(self, start_time, end_time, number, mass, growth, held, error)
      class(detached_packets_type), intent(inout) :: self
      real(wp), intent(in) :: start_time, end_time, number, mass, growth
      !> Under a changing load, their numbers by the heights of sites
      real(wp), intent(in) :: held(:)
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      call self%number%add(number)
      call self%mass%add(mass)
      if (allocated(self%held)) self%held = self%held + held
      if (.not. (self%reattach .and. number > 0.0_wp)) return
      if (self%is_random) then
         self%fresh = [number, mass]
         if (allocated(self%held)) self%fresh_held = held
         return
      end if
      ! Few pending contacts count as broken together with more that follow: their delay is not
      ! extended back. Where contacts break all the time, gaps between packets would end steps.
      if (number >= self%pending(row_number) &
         & .and. .not. self%continues(start_time, end_time, number)) then
         self%pending(row_start) = start_time
      end if
      if (number >= self%pending(row_number)) self%pending(row_growth) = growth
      self%pending(row_end) = end_time
      self%pending(row_number) = self%pending(row_number) + number
      self%pending(row_mass) = self%pending(row_mass) + mass
      if (allocated(self%held)) self%pending_held = self%pending_held + held
      if (self%pending(row_number) < self%negligible) return
      if (self%last == size(self%packet, 2)) call self%make_room(error)
      if (allocated(error)) return
      self%last = self%last + 1
      self%packet(:, self%last) = self%pending
      if (allocated(self%held)) then
         self%mix(:, self%last) = self%pending_held / sum(self%pending_held)
         self%pending_held = 0.0_wp
      end if
      self%pending = 0.0_wp
   end subroutine add

   !> Whether breaks continue those of the pending contacts, at once and not much faster.
   pure function continues(self, start_time, end_time, number)
      class(detached_packets_type), intent(in) :: self
      real(wp), intent(in) :: start_time, end_time, number
      logical :: continues

      associate (pending => self%pending)
         continues = self%short_gap > 0.0_wp .and. pending(row_number) > 0.0_wp &
            & .and. pending(row_end) >= start_time &
            & .and. number * (pending(row_end) - pending(row_start)) &
            & <= max_rate_ratio * pending(row_number) * (end_time - start_time)
      end associate
   end function continues

   !> Whether no contact waits to attach.
   pure function is_empty(self)
      class(detached_packets_type), intent(in) :: self
      logical :: is_empty

      is_empty = self%first > self%last
      if (self%is_random) is_empty = .not. self%reattach &
         & .or. .not. self%number%total() > self%negligible
   end function is_empty

   !> Make room for one more packet: where some have attached, or in a larger array.
   subroutine make_room(self, error)
      class(detached_packets_type), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error

      real(wp), allocatable :: larger(:, :), mix(:, :)
      integer :: waiting, index, stat

      waiting = self%last - self%first + 1
      if (2 * waiting > size(self%packet, 2)) then
         allocate (larger(packet_length, 2 * size(self%packet, 2)), source=0.0_wp, stat=stat)
         if (stat == 0 .and. allocated(self%mix)) then
            allocate (mix(size(self%mix, 1), 2 * size(self%packet, 2)), source=0.0_wp, stat=stat)
         end if
         if (stat /= 0) then
            call raise(error, status_memory, "not enough memory for the detached contacts")
            return
         end if
         larger(:, :waiting) = self%packet(:, self%first:self%last)
         call move_alloc(larger, self%packet)
         if (allocated(mix)) then
            mix(:, :waiting) = self%mix(:, self%first:self%last)
            call move_alloc(mix, self%mix)
         end if
      else
         ! Assignments of whole parts would be copied first.
         do index = 1, waiting
            self%packet(:, index) = self%packet(:, self%first - 1 + index)
            if (allocated(self%mix)) self%mix(:, index) = self%mix(:, self%first - 1 + index)
         end do
      end if
      self%first = 1
      self%last = waiting
   end subroutine make_room

   !> Times at which the remaining contacts of a packet attach, from the first to the last [s].
   pure subroutine due_times(self, index, early, late)
      class(detached_packets_type), intent(in) :: self
      integer, intent(in) :: index
      real(wp), intent(out) :: early, late

      early = self%packet(row_start, index) + self%delay
      late = self%packet(row_end, index) + self%delay
      if (index == self%first) early = early + self%first_part * (late - early)
   end subroutine due_times

   !> Part of a packet that attaches until a part of its time.
   elemental function part_until(time, growth) result(part)
      real(wp), intent(in) :: time, growth
      real(wp) :: part

      part = time * (1.0_wp - growth * (1.0_wp - time))
   end function part_until

   !> Mean of the times at which contacts attach between two parts of the time of their packet.
   elemental function mean_time(first, last, growth) result(time)
      real(wp), intent(in) :: first, last, growth
      real(wp) :: time

      real(wp) :: rate

      time = 0.5_wp * (first + last)
      rate = 1.0_wp + growth * (2.0_wp * time - 1.0_wp)
      if (rate > 0.0_wp) time = time + growth * (last - first)**2 / (6.0_wp * rate)
   end function mean_time

   !> Part of the time of a packet until which a part of its contacts has attached, the inverse of
   !> part_until.
   elemental function time_of_part(part, growth) result(time)
      real(wp), intent(in) :: part, growth
      real(wp) :: time

      real(wp) :: start_rate

      time = 0.0_wp
      start_rate = 1.0_wp - growth
      if (part > 0.0_wp) time = min(1.0_wp, 2.0_wp * part &
         & / (start_rate + sqrt(max(0.0_wp, start_rate**2 + 4.0_wp * growth * part))))
   end function time_of_part

   !> Contacts that will attach in a step, and how long it may last for that.
   subroutine expect(self, time, duration, max_births, breaks, births)
      class(detached_packets_type), intent(in) :: self
      !> Start of the step, and its duration if nothing ends it [s]
      real(wp), intent(in) :: time, duration
      !> Maximum number of contacts that attach in one step
      real(wp), intent(in) :: max_births
      !> Whether contacts break in the step
      logical, intent(in) :: breaks
      type(expected_births_type), intent(out) :: births

      real(wp) :: early, late, until
      integer :: index

      if (self%is_random) then
         call self%expect_random(time, duration, max_births, breaks, births)
         return
      end if
      until = time
      do index = self%first, self%last
         call self%due_times(index, early, late)
         if (early > until + self%short_gap * duration) then
            ! Nothing attaches for a while: the step ends where that changes.
            births%end_time = early
            if (births%number > 0.0_wp) births%end_time = until
            return
         end if
         call add_packet(self%packet(:, index), merge(self%first_part, 0.0_wp, index == self%first))
         if (births%end_time < huge(1.0_wp)) return
         if (late >= time + duration) then
            ! The expectation holds for about the expected duration.
            births%end_time = time_after(time, patience * duration)
            return
         end if
         until = late
      end do
      if (self%reattach .and. self%delay < duration .and. breaks) then
         ! Contacts that break in this step start to attach in it.
         births%end_time = min(births%end_time, time_after(time, patience * duration))
      else if (births%number > 0.0_wp) then
         births%end_time = until
      end if

   contains

      !> Add the contacts of a packet that attach from a part of its time on.
      subroutine add_packet(packet, first)
         real(wp), intent(in) :: packet(:), first

         real(wp) :: more, last, length, before

         associate (number => packet(row_number), growth => packet(row_growth))
            length = packet(row_end) - packet(row_start)
            before = part_until(first, growth)
            last = 1.0_wp
            if (late > time + duration) then
               last = first
               if (time + duration > early) last = min(1.0_wp, first + (time + duration - early) &
                  & / length)
            end if
            more = number * max(0.0_wp, part_until(last, growth) - before)
            if (births%number + more > max_births) then
               more = max_births - births%number
               last = max(first, time_of_part(before + more / number, growth))
               births%end_time = max(early + (last - first) * length, nearest(time, 1.0_wp))
            end if
            births%number = births%number + more
            births%mass = births%mass + more * packet(row_mass) / number
            births%wait = births%wait + more * (early - time &
               & + (mean_time(first, last, growth) - first) * length)
         end associate
      end subroutine add_packet

   end subroutine expect

   !> Take out all contacts that are due to attach.
   subroutine take_due(self, before, after, births, moment, square, when, held)
      class(detached_packets_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after
      !> Their number, and sums over them of the displacement in the motion at which they attach
      !> [m], of its square [m2], and of the time [s]
      real(wp), intent(out) :: births, moment, square, when
      !> Under a changing load, their numbers by the heights of sites
      real(wp), intent(inout) :: held(:)

      real(wp) :: early, late, part, part_before, more, attached, when_more, spread, distance(2)

      births = 0.0_wp
      moment = 0.0_wp
      square = 0.0_wp
      when = 0.0_wp
      held = 0.0_wp
      if (self%is_random) call self%take_random(before, after, births, moment, square, when, held)
      do while (self%first <= self%last)
         call self%due_times(self%first, early, late)
         if (early > after%time) exit
         part_before = self%first_part
         part = 1.0_wp
         if (late > after%time) then
            part = part_before + (1.0_wp - part_before) * (after%time - early) / (late - early)
         end if
         associate (packet => self%packet(:, self%first))
            attached = part_until(part, packet(row_growth)) &
               & - part_until(part_before, packet(row_growth))
            more = packet(row_number) * attached
            when_more = packet(row_start) + self%delay + (packet(row_end) - packet(row_start)) &
               & * mean_time(part_before, part, packet(row_growth))
            births = births + more
            if (allocated(self%mix)) held = held + more * self%mix(:, self%first)
            ! Two points with the mean and about the variance of the times.
            spread = (packet(row_end) - packet(row_start)) * (part - part_before) &
               & / sqrt(12.0_wp)
            distance = position_at(before, after, when_more + [-spread, spread]) &
               & - before%displacement
            moment = moment + 0.5_wp * more * sum(distance)
            square = square + 0.5_wp * more * sum(distance**2)
            when = when + more * when_more
            call self%mass%add(-packet(row_mass) * attached)
         end associate
         self%first_part = part
         if (part < 1.0_wp) exit
         self%first_part = 0.0_wp
         self%first = self%first + 1
      end do
      if (self%first > self%last) then
         self%first = 1
         self%last = 0
      end if
      if (births > 0.0_wp) call self%number%add(-births)
      if (allocated(self%held)) self%held = max(0.0_wp, self%held - held)
   end subroutine take_due

   !> Part of the contacts that break in a step of a duration [s] which attaches in it, given the
   !> growth of their rate.
   elemental function own_part(self, duration, growth) result(part)
      class(detached_packets_type), intent(in) :: self
      real(wp), intent(in) :: duration, growth
      real(wp) :: part

      part = 0.0_wp
      if (.not. self%reattach) return
      if (self%is_random) then
         part = own_attached_part(duration / self%delay)
      else if (self%delay < duration) then
         part = part_until(1.0_wp - self%delay / duration, growth)
      end if
   end function own_part

   !> Mean part of the displacement in the step at which these attach. Without growth this is also
   !> the mean part of its duration.
   elemental function own_place(self, duration, growth) result(place)
      class(detached_packets_type), intent(in) :: self
      real(wp), intent(in) :: duration, growth
      real(wp) :: place

      real(wp) :: wait, last

      if (self%is_random) then
         place = mean_own_time(duration / self%delay)
         return
      end if
      ! With a linear velocity contacts break at the part p(t) of the displacement, and attach at
      ! p(t + wait).
      wait = min(1.0_wp, self%delay / duration)
      last = 1.0_wp - wait
      place = 0.5_wp * part_until(last, growth) + wait * (1.0_wp - growth * last) &
         & + 2.0_wp * growth * wait * mean_time(0.0_wp, last, growth)
   end function own_place

   !> The same as expect for exponential delays.
   subroutine expect_random(self, time, duration, max_births, breaks, births)
      class(detached_packets_type), intent(in) :: self
      real(wp), intent(in) :: time, duration, max_births
      logical, intent(in) :: breaks
      type(expected_births_type), intent(inout) :: births

      real(wp) :: number, part, length

      if (self%is_empty()) then
         if (self%reattach .and. breaks .and. duration < max_time) then
            births%end_time = time_after(time, patience * duration)
         end if
         return
      end if
      number = self%number%total()
      ! At rest all but a negligible number attaches in a step.
      length = duration
      if (duration >= max_time) length = self%delay * log(number / self%negligible)
      part = attached_part(length / self%delay)
      births%end_time = time_after(time, patience * length)
      if (part * number > max_births) then
         part = max_births / number
         length = -self%delay * log(1.0_wp - part)
         births%end_time = time_after(time, length)
      end if
      births%number = part * number
      births%mass = part * self%mass%total()
      births%wait = births%number * length * mean_attached_time(length / self%delay)
   end subroutine expect_random

   !> The same as take_due for exponential delays.
   subroutine take_random(self, before, after, births, moment, square, when, held)
      class(detached_packets_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after
      real(wp), intent(inout) :: births, moment, square, when, held(:)

      real(wp) :: duration, ratio, part(2), number(2), time(2), length

      duration = after%time - before%time
      ratio = duration / self%delay
      ! Contacts detached at the start of the step, and those that broke in it.
      part = [attached_part(ratio), own_attached_part(ratio)]
      time = before%time + duration * [mean_attached_time(ratio), mean_own_time(ratio)]
      number = part * [max(0.0_wp, self%number%total() - self%fresh(1)), self%fresh(1)]
      births = sum(number)
      if (allocated(self%held)) then
         held = part(1) * max(0.0_wp, self%held - self%fresh_held) + part(2) * self%fresh_held
         self%fresh_held = 0.0_wp
      end if
      moment = sum(number * (position_at(before, after, time) - before%displacement))
      ! Nearly even over the motion.
      length = after%displacement - before%displacement
      if (births > 0.0_wp) square = moment**2 / births + births * length**2 / 12.0_wp
      when = sum(number * time)
      call self%mass%add(-part(1) * max(0.0_wp, self%mass%total() - self%fresh(2)) &
         & - part(2) * self%fresh(2))
      self%fresh = 0.0_wp
   end subroutine take_random

   !> Shorten a step in which contacts break to a time [s], and expect its births again.
   subroutine shorten_step(self, pose, direction, time, max_births, span, distance, births)
      class(detached_packets_type), intent(in) :: self
      type(pose_type), intent(in) :: pose
      !> Direction of the motion, and maximum number of contacts that attach
      real(wp), intent(in) :: direction, time, max_births
      !> Duration of the step [s], and displacement in it [m]
      real(wp), intent(inout) :: span, distance
      type(expected_births_type), intent(inout) :: births

      real(wp) :: end_time

      end_time = births%end_time
      call self%expect(pose%time, time, max_births, .true., births)
      births%end_time = min(end_time, births%end_time)
      span = min(time, births%end_time - pose%time)
      distance = distance_in(pose, direction, span)
   end subroutine shorten_step

   !> Keep parts of the contacts by the heights of their sites.
   subroutine keep(self, part)
      class(detached_packets_type), intent(inout) :: self
      real(wp), intent(in) :: part(:)

      real(wp) :: number, mass, share, lost_mass
      integer :: index

      number = sum(self%held)
      mass = self%mass%total()
      self%held = part * self%held
      share = 0.0_wp
      if (number > 0.0_wp) share = sum(self%held) / number
      lost_mass = (1.0_wp - share) * mass
      if (self%is_random) then
         self%fresh_held = part * self%fresh_held
         if (self%fresh(1) > 0.0_wp) self%fresh = self%fresh * sum(self%fresh_held) / self%fresh(1)
      else if (self%reattach) then
         lost_mass = 0.0_wp
         do index = self%first, self%last
            associate (mix => self%mix(:, index), packet => self%packet(:, index))
               mix = part * mix
               share = sum(mix)
               if (share > 0.0_wp) mix = mix / share
               lost_mass = lost_mass + (1.0_wp - share) * packet(row_mass) &
                  & * (1.0_wp - part_until(merge(self%first_part, 0.0_wp, index == self%first), &
                  & packet(row_growth)))
               packet(row_number:row_mass) = share * packet(row_number:row_mass)
            end associate
         end do
         call self%remove_empty()
         if (self%pending(row_number) > 0.0_wp) then
            share = sum(part * self%pending_held) / sum(self%pending_held)
            self%pending_held = part * self%pending_held
            lost_mass = lost_mass + (1.0_wp - share) * self%pending(row_mass)
            self%pending(row_number:row_mass) = share * self%pending(row_number:row_mass)
            if (.not. share > 0.0_wp) self%pending = 0.0_wp
         end if
      end if
      self%number = accumulator_type()
      self%mass = accumulator_type()
      if (.not. sum(self%held) > 0.0_wp) return
      call self%number%add(sum(self%held))
      call self%mass%add(max(0.0_wp, mass - lost_mass))
   end subroutine keep

   !> Remove packets without contacts.
   subroutine remove_empty(self)
      class(detached_packets_type), intent(inout) :: self

      integer :: index, last

      last = self%first - 1
      do index = self%first, self%last
         if (.not. self%packet(row_number, index) > 0.0_wp) then
            if (index == self%first) self%first_part = 0.0_wp
            cycle
         end if
         last = last + 1
         if (last == index) cycle
         self%packet(:, last) = self%packet(:, index)
         self%mix(:, last) = self%mix(:, index)
      end do
      self%last = last
   end subroutine remove_empty

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      class(detached_packets_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      real(wp), allocatable :: pending(:)

      call archive%section("detached packets")
      call archive%exchange("packet", self%packet)
      pending = self%pending
      call archive%exchange("pending", pending)
      if (size(pending) == packet_length) self%pending = pending
      call archive%exchange("first", self%first)
      call archive%exchange("last", self%last)
      call archive%exchange("first_part", self%first_part)
      call archive%exchange("number", self%number)
      call archive%exchange("mass", self%mass)
      if (allocated(self%held)) then
         call archive%exchange("held", self%held)
         call archive%exchange("pending_held", self%pending_held)
         call archive%exchange("fresh_held", self%fresh_held)
         call archive%exchange("mix", self%mix)
      end if
      if (.not. self%is_random) return
      pending = self%fresh
      call archive%exchange("fresh", pending)
      if (size(pending) == size(self%fresh)) self%fresh = pending
   end subroutine exchange

end module mesoslip_contacts_populations_packets
