!> N contacts with random thresholds: when they break, when they attach again, and their force.
!>
!> The earthquake-like model. Displacements are relative to an origin that the caller moves along
!> (see shift_origin). State is plain arrays owned by the caller; the queue is derived from them.
module mesoslip_contact_ensemble
   use mesoslip_kinds, only: i8, wp
   use mesoslip_errors, only: error_type
   use mesoslip_accumulator, only: accumulator_type
   use mesoslip_archive, only: archive_type
   use mesoslip_random, only: uniform_pair
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_contacts, only: contact_parameters_type, contacts_type
   use mesoslip_contact_mechanics, only: coupling_scaled, initial_steady, initial_uniform
   use mesoslip_contact_record, only: record_length, row_origin, row_stiffness, row_limit, &
      & row_renewal, ahead_coordinate, behind_coordinate
   use mesoslip_contact_queue, only: contact_queue_type, new_contact_queue
   implicit none
   private

   public :: contact_ensemble_type, new_contact_ensemble
   public :: detached_length

   !> Numbers kept for a detached contact
   integer, parameter :: detached_length = 3
   !> When it attaches again [s]
   integer, parameter :: row_due = 1
   !> Its drag while it is detached [N s/m]
   integer, parameter :: row_drag = 2
   !> The relative threshold it will have
   integer, parameter :: row_threshold = 3

   !> A probability too small to meet among the keys of a ring of buckets.
   real(wp), parameter :: rare = 1.0e-4_wp

   !> An ensemble of contacts.
   type, extends(contacts_type) :: contact_ensemble_type
      !> Time at which the next contact attaches; huge when there is none [s]
      real(wp) :: next_attachment = huge(1.0_wp)
      !> Bound on the coordinates at which contacts break on the way back [m]
      real(wp) :: behind = -huge(1.0_wp)
      !> Direction of motion for which the queue is kept, +1 or -1
      real(wp) :: direction = 1.0_wp

      type(accumulator_type), private :: stiffness, offset, drag
      !> Number of contacts that are detached, and their first place in the ring
      integer, private :: waiting = 0, first_detached = 0
      type(contact_queue_type), private :: queue
      real(wp), pointer, contiguous, private :: record(:, :) => null()
      real(wp), pointer, contiguous, private :: detached(:, :) => null()
      integer, pointer, contiguous, private :: detached_contact(:) => null()
   contains
      procedure :: initialize
      procedure :: law
      procedure :: offer
      procedure :: respond
      procedure :: has_room
      procedure :: shift_origin
      procedure :: elastic_energy
      procedure :: exchange
      procedure :: rebuild
      procedure, private :: bear, break_due, break_first, attach_first, face, farthest_behind
   end type contact_ensemble_type

contains

   !> Set up an ensemble on arrays of the caller.
   subroutine new_contact_ensemble(self, parameters, record, detached, detached_contact, error)
      !> The ensemble
      type(contact_ensemble_type), intent(out) :: self
      !> What the contacts are made of
      type(contact_parameters_type), intent(in) :: parameters
      !> Records of the contacts, shape (record_length, count)
      real(wp), intent(inout), target, contiguous :: record(:, :)
      !> A ring of detached contacts in the order of attaching, shape (detached_length, count)
      real(wp), intent(inout), target, contiguous :: detached(:, :)
      !> Numbers of the contacts in that ring, shape (count)
      integer, intent(inout), target, contiguous :: detached_contact(:)
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(out) :: error

      real(wp) :: longest

      self%parameters = parameters
      self%record => record
      self%detached => detached
      self%detached_contact => detached_contact
      ! A contact attached while the slider moves back has the back force to lose as well.
      longest = parameters%static_force / parameters%stiffness &
         & * max(parameters%law%quantile(rare), 1.0_wp) * (1.0_wp + parameters%back_force_ratio)
      call new_contact_queue(self%queue, parameters%count, 1.1_wp * longest, error)
   end subroutine new_contact_ensemble

   !> Draw all contacts for the start of a run.
   subroutine initialize(self, state)
      !> The ensemble
      class(contact_ensemble_type), intent(inout) :: self
      !> One of the initial_ codes
      integer, intent(in) :: state

      integer :: contact
      integer(i8) :: attempt
      real(wp) :: uniform(2), threshold, largest, stiffness, limit, back, stretch

      largest = self%parameters%law%quantile(2.0_wp**(-53))
      do contact = 1, self%parameters%count
         attempt = 0
         do
            call uniform_pair(self%parameters%seed, self%parameters%realization, &
               & int(contact - 1, i8), 0_i8, attempt, uniform)
            threshold = self%parameters%law%quantile(uniform(1))
            ! Thresholds of sliding contacts are weighted by how far the contact is carried.
            if (state /= initial_steady) exit
            call uniform_pair(self%parameters%seed, self%parameters%realization, &
               & int(contact - 1, i8), 0_i8, attempt + 1, uniform)
            if (uniform(1) * carried(self%parameters, largest) &
               & <= carried(self%parameters, threshold)) exit
            attempt = attempt + 2
         end do

         call born(self%parameters, threshold, stiffness, limit)
         select case (state)
         case (initial_steady)
            back = self%parameters%back_force_ratio * self%parameters%static_force / stiffness
            stretch = back + uniform(2) * (limit - back)
         case (initial_uniform)
            stretch = uniform(2) * limit
         case default
            stretch = 0.0_wp
         end select
         self%record(row_origin, contact) = -stretch
         self%record(row_stiffness, contact) = stiffness
         self%record(row_limit, contact) = limit
         self%record(row_renewal, contact) = 0.0_wp
      end do
      call self%bear()
      call self%rebuild(0.0_wp)
      self%behind = self%farthest_behind()
   end subroutine initialize

   !> Contact force as a law.
   pure function law(self)
      !> The ensemble
      class(contact_ensemble_type), intent(in) :: self
      !> The law that holds until a contact breaks or attaches
      type(interface_law_type) :: law

      law%stiffness = self%stiffness%total()
      law%offset = self%offset%total()
      law%drag = self%drag%total()
   end function law

   !> Contact force as a law, which holds until a contact breaks or attaches.
   subroutine offer(self, pose, law, window)
      !> The ensemble
      class(contact_ensemble_type), intent(inout) :: self
      !> Where the slider is
      type(pose_type), intent(in) :: pose
      !> The law
      type(interface_law_type), intent(out) :: law
      !> Where it holds; a contact may break at its lower end if the motion is forward
      type(window_type), intent(out) :: window

      law%stiffness = self%stiffness%total()
      law%offset = self%offset%total()
      law%drag = self%drag%total()
      window%end_time = self%next_attachment
      if (self%direction > 0.0_wp) then
         window%upper = self%queue%first_key
         window%lower = self%behind
      else
         window%upper = -self%behind
         window%lower = -self%queue%first_key
      end if
   end subroutine offer

   !> Break all contacts that are due, then attach those that are, in the order in which they broke.
   subroutine respond(self, before, after)
      !> The ensemble
      class(contact_ensemble_type), intent(inout) :: self
      !> Where the slider was, and where it is
      type(pose_type), intent(in) :: before, after

      call self%break_due(after%displacement, after%time)
      do while (self%next_attachment <= after%time)
         call self%attach_first(after%displacement, after%sense)
      end do
      self%detached_count = real(self%waiting, wp)
   end subroutine respond

   !> Break all contacts that are due.
   subroutine break_due(self, displacement, time)
      class(contact_ensemble_type), intent(inout) :: self
      real(wp), intent(in) :: displacement, time

      if (self%direction * displacement <= self%behind) then
         ! The bound may be that of a contact which has broken since.
         self%behind = self%farthest_behind()
         if (self%direction * displacement <= self%behind) call self%face(displacement)
      end if
      do while (self%queue%first_key <= self%direction * displacement)
         call self%break_first(displacement, time)
      end do
   end subroutine break_due

   !> Whether there is room for one more step: the arrays have a place for each contact.
   pure function has_room(self)
      !> The ensemble
      class(contact_ensemble_type), intent(in) :: self
      !> Always
      logical :: has_room

      has_room = size(self%record, 2) >= self%parameters%count
   end function has_room

   !> Break the first contact of the queue.
   subroutine break_first(self, displacement, time)
      class(contact_ensemble_type), intent(inout) :: self
      real(wp), intent(in) :: displacement, time

      integer :: contact, place
      real(wp) :: stiffness, origin, renewal, uniform(2), drag

      call self%queue%pop(self%record, contact)
      origin = self%record(row_origin, contact)
      stiffness = self%record(row_stiffness, contact)
      renewal = self%record(row_renewal, contact) + 1.0_wp
      self%record(row_stiffness, contact) = 0.0_wp
      self%record(row_renewal, contact) = renewal

      drag = self%parameters%drag
      if (self%parameters%coupling == coupling_scaled) then
         drag = drag * (stiffness / self%parameters%stiffness)**2
      end if
      call self%break_loss%add(0.5_wp * stiffness * (displacement - origin)**2)
      call self%stiffness%add(-stiffness)
      call self%offset%add(-stiffness * origin)
      call self%drag%add(drag)
      if (self%queue%count == 0) then
         self%stiffness = accumulator_type()
         self%offset = accumulator_type()
      end if
      self%breaks = self%breaks + 1.0_wp

      ! The next threshold is drawn now, while the contact's record is at hand.
      call uniform_pair(self%parameters%seed, self%parameters%realization, int(contact - 1, i8), &
         & int(renewal, i8), 0_i8, uniform)
      place = self%first_detached + self%waiting
      if (place >= self%parameters%count) place = place - self%parameters%count
      self%waiting = self%waiting + 1
      self%detached_contact(place + 1) = contact
      self%detached(row_due, place + 1) = time + self%parameters%delay
      self%detached(row_drag, place + 1) = drag
      self%detached(row_threshold, place + 1) = self%parameters%law%quantile(uniform(1))
      if (self%waiting == 1 .and. self%parameters%reattach) then
         self%next_attachment = self%detached(row_due, place + 1)
      end if
   end subroutine break_first

   !> Attach the contact that broke first.
   subroutine attach_first(self, displacement, sense)
      class(contact_ensemble_type), intent(inout) :: self
      real(wp), intent(in) :: displacement, sense

      integer :: contact, place
      real(wp) :: stiffness, limit, origin, back_force

      place = self%first_detached + 1
      contact = self%detached_contact(place)
      back_force = self%parameters%back_force_ratio * self%parameters%static_force
      call born(self%parameters, self%detached(row_threshold, place), stiffness, limit)
      origin = displacement - sense * back_force / stiffness

      call self%drag%add(-self%detached(row_drag, place))
      self%waiting = self%waiting - 1
      self%first_detached = place
      if (place == self%parameters%count) self%first_detached = 0
      self%next_attachment = huge(1.0_wp)
      if (self%waiting > 0) then
         self%next_attachment = self%detached(row_due, self%first_detached + 1)
      else
         self%drag = accumulator_type()
      end if

      call self%birth_gain%add(0.5_wp * stiffness * (displacement - origin)**2)
      call self%stiffness%add(stiffness)
      call self%offset%add(stiffness * origin)
      self%record(row_origin, contact) = origin
      self%record(row_stiffness, contact) = stiffness
      self%record(row_limit, contact) = limit
      call self%queue%insert(contact, self%direction * origin + limit)
      self%behind = max(self%behind, self%direction * origin - limit)
   end subroutine attach_first

   !> Turn round: keep the queue for the other direction of motion.
   subroutine face(self, displacement)
      class(contact_ensemble_type), intent(inout) :: self
      real(wp), intent(in) :: displacement

      self%direction = -self%direction
      call self%rebuild(displacement)
      self%behind = self%farthest_behind()
   end subroutine face

   !> Move the origin of displacements.
   subroutine shift_origin(self, shift, displacement)
      !> The ensemble
      class(contact_ensemble_type), intent(inout) :: self
      !> Displacement of the new origin [m]
      real(wp), intent(in) :: shift
      !> Displacement of the slider from the new origin [m]
      real(wp), intent(in) :: displacement

      integer :: contact

      do contact = 1, self%parameters%count
         self%record(row_origin, contact) = self%record(row_origin, contact) - shift
      end do
      call self%bear()
      call self%rebuild(displacement)
      self%behind = self%farthest_behind()
   end subroutine shift_origin

   !> Sum stiffness and offset anew, from the records.
   subroutine bear(self)
      class(contact_ensemble_type), intent(inout) :: self

      integer :: contact

      self%stiffness = accumulator_type()
      self%offset = accumulator_type()
      do contact = 1, self%parameters%count
         call self%stiffness%add(self%record(row_stiffness, contact))
         call self%offset%add(self%record(row_stiffness, contact) &
            & * self%record(row_origin, contact))
      end do
   end subroutine bear

   !> Order the queue anew, from the records.
   subroutine rebuild(self, displacement)
      !> The ensemble
      class(contact_ensemble_type), intent(inout) :: self
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement

      integer :: contact

      call self%queue%clear(self%direction, self%direction * displacement)
      do contact = 1, self%parameters%count
         if (self%record(row_stiffness, contact) > 0.0_wp) then
            call self%queue%insert(contact, &
               & ahead_coordinate(self%record(:, contact), self%direction))
         end if
      end do
   end subroutine rebuild

   !> Greatest coordinate at which a pinned contact breaks on the way back.
   pure function farthest_behind(self) result(coordinate)
      class(contact_ensemble_type), intent(in) :: self
      real(wp) :: coordinate

      integer :: contact

      coordinate = -huge(1.0_wp)
      do contact = 1, self%parameters%count
         if (self%record(row_stiffness, contact) > 0.0_wp) then
            coordinate = max(coordinate, &
               & behind_coordinate(self%record(:, contact), self%direction))
         end if
      end do
   end function farthest_behind

   !> Elastic energy of the pinned contacts.
   pure function elastic_energy(self, displacement) result(energy)
      !> The ensemble
      class(contact_ensemble_type), intent(in) :: self
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement
      !> Energy [J]
      real(wp) :: energy

      integer :: contact
      type(accumulator_type) :: total

      do contact = 1, self%parameters%count
         call total%add(0.5_wp * self%record(row_stiffness, contact) &
            & * (displacement - self%record(row_origin, contact))**2)
      end do
      energy = total%total()
   end function elastic_energy

   !> Put the state into an archive or take it out; the arrays of the caller are the rest of it.
   subroutine exchange(self, archive)
      !> The ensemble
      class(contact_ensemble_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call archive%exchange(self%waiting)
      call archive%exchange(self%first_detached)
      call archive%exchange(self%next_attachment)
      call archive%exchange(self%breaks)
      call archive%exchange(self%detached_count)
      call archive%exchange(self%break_loss)
      call archive%exchange(self%birth_gain)
      call archive%exchange(self%behind)
      call archive%exchange(self%direction)
      call archive%exchange(self%stiffness)
      call archive%exchange(self%offset)
      call archive%exchange(self%drag)
   end subroutine exchange

   !> Stiffness and breaking stretch of a contact that is born with a relative threshold.
   pure subroutine born(parameters, threshold, stiffness, limit)
      type(contact_parameters_type), intent(in) :: parameters
      real(wp), intent(in) :: threshold
      real(wp), intent(out) :: stiffness, limit

      stiffness = parameters%stiffness
      if (parameters%coupling == coupling_scaled) stiffness = stiffness * sqrt(threshold)
      limit = threshold * parameters%static_force / stiffness
   end subroutine born

   !> How far the slider carries a contact from attaching to breaking.
   pure function carried(parameters, threshold) result(distance)
      type(contact_parameters_type), intent(in) :: parameters
      real(wp), intent(in) :: threshold
      real(wp) :: distance

      real(wp) :: stiffness, limit

      call born(parameters, threshold, stiffness, limit)
      distance = limit - parameters%back_force_ratio * parameters%static_force / stiffness
   end function carried

end module mesoslip_contact_ensemble
