!> Contacts of an interface with a length: those of each block in a row (section 16 of the model).
!>
!> Each block has contacts of the same kind with random numbers of their own; block 1 has those of a
!> rigid slider. The loop lets the blocks respond one by one; here is what they are together.
module mesoslip_contacts_row
   use mesoslip_contacts_base, only: contact_record_length, contacts_type
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_kinds, only: i8, wp
   implicit none
   private

   public :: contact_row_type, block_contacts_type, block_key

   !> Bits by which the keys of the random numbers of two realizations differ at most
   integer, parameter :: realization_bits = 40

   !> The contacts of a block.
   type :: block_contacts_type
      class(contacts_type), allocatable :: contacts
      !> Pose of the block when its contacts offered their law
      type(pose_type) :: pose
   end type block_contacts_type

   !> The contacts of all blocks.
   type, extends(contacts_type) :: contact_row_type
      type(block_contacts_type), allocatable :: block(:)
   contains
      procedure :: initialize, law, offer, respond, shift_origin, elastic_energy, exchange, rebuild
      procedure :: individual_count, snapshot, records, gather
      procedure, non_overridable :: add_counts, counts, look_for_failure
   end type contact_row_type

contains

   !> Key of the random numbers of a block, from that of the realization.
   pure function block_key(realization, block) result(key)
      integer(i8), intent(in) :: realization
      integer, intent(in) :: block
      integer(i8) :: key

      key = realization + ishft(int(block - 1, i8), realization_bits)
   end function block_key

   subroutine initialize(self, state)
      class(contact_row_type), intent(inout) :: self
      integer, intent(in) :: state

      integer :: block

      do block = 1, size(self%block)
         call self%block(block)%contacts%initialize(state)
      end do
      call self%look_for_failure()
   end subroutine initialize

   pure function law(self)
      class(contact_row_type), intent(in) :: self
      type(interface_law_type) :: law

      type(interface_law_type) :: one
      integer :: block

      do block = 1, size(self%block)
         one = self%block(block)%contacts%law()
         law%stiffness = law%stiffness + one%stiffness
         law%offset = law%offset + one%offset
         law%drag = law%drag + one%drag
         law%rate = law%rate + one%rate
      end do
   end function law

   !> Blocks offer their laws one by one: there is none for all.
   subroutine offer(self, pose, law, window)
      class(contact_row_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      type(interface_law_type), intent(out) :: law
      type(window_type), intent(out) :: window

      call raise(self%failure, status_invalid, "contacts of blocks need a slider of blocks")
   end subroutine offer

   subroutine respond(self, before, after)
      class(contact_row_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      call raise(self%failure, status_invalid, "contacts of blocks need a slider of blocks")
   end subroutine respond

   subroutine shift_origin(self, shift, displacement)
      class(contact_row_type), intent(inout) :: self
      real(wp), intent(in) :: shift, displacement

      integer :: block

      do block = 1, size(self%block)
         associate (pose => self%block(block)%pose)
            pose%displacement = pose%displacement - shift
            call self%block(block)%contacts%shift_origin(shift, pose%displacement)
         end associate
      end do
   end subroutine shift_origin

   !> Elastic energy where the blocks are.
   pure function elastic_energy(self, displacement) result(energy)
      class(contact_row_type), intent(in) :: self
      real(wp), intent(in) :: displacement
      real(wp) :: energy

      integer :: block

      energy = 0.0_wp
      do block = 1, size(self%block)
         energy = energy + self%block(block)%contacts%elastic_energy( &
            & self%block(block)%pose%displacement)
      end do
   end function elastic_energy

   !> Add up the energies and errors of all blocks.
   subroutine gather(self)
      class(contact_row_type), intent(inout) :: self

      integer :: block

      self%break_loss = accumulator_type()
      self%birth_gain = accumulator_type()
      self%separation_loss = accumulator_type()
      self%step_work = accumulator_type()
      self%error_estimate = 0.0_wp
      do block = 1, size(self%block)
         associate (one => self%block(block)%contacts)
            call self%break_loss%add(one%break_loss%total())
            call self%birth_gain%add(one%birth_gain%total())
            call self%separation_loss%add(one%separation_loss%total())
            call self%step_work%add(one%step_work%total())
            self%error_estimate = self%error_estimate + one%error_estimate
         end associate
      end do
   end subroutine gather

   !> Add the changes of a block's counts to those of all.
   pure subroutine add_counts(self, detached, breaks)
      class(contact_row_type), intent(inout) :: self
      !> Changes of the numbers of detached contacts and of breaks
      real(wp), intent(in) :: detached, breaks

      self%detached_count = self%detached_count + detached
      self%breaks = self%breaks + breaks
   end subroutine add_counts

   !> Numbers of contacts of the blocks.
   pure function counts(self)
      class(contact_row_type), intent(in) :: self
      integer :: counts(size(self%block))

      integer :: block

      do block = 1, size(counts)
         counts(block) = self%block(block)%contacts%parameters%count
      end do
   end function counts

   !> Take over the failure of a block.
   subroutine look_for_failure(self)
      class(contact_row_type), intent(inout) :: self

      integer :: block

      do block = 1, size(self%block)
         if (.not. allocated(self%block(block)%contacts%failure)) cycle
         self%failure = self%block(block)%contacts%failure
         return
      end do
   end subroutine look_for_failure

   pure function individual_count(self) result(number)
      class(contact_row_type), intent(in) :: self
      integer :: number

      integer :: block

      number = 0
      do block = 1, size(self%block)
         number = number + self%block(block)%contacts%individual_count()
      end do
   end function individual_count

   !> State of each contact, block by block.
   pure subroutine snapshot(self, time, displacement, values)
      class(contact_row_type), intent(in) :: self
      real(wp), intent(in) :: time, displacement
      real(wp), intent(out) :: values(:, :)

      integer :: block, first, number

      first = 0
      do block = 1, size(self%block)
         number = self%block(block)%contacts%individual_count()
         call self%block(block)%contacts%snapshot(time, self%block(block)%pose%displacement, &
            & values(:, first + 1:first + number))
         first = first + number
      end do
   end subroutine snapshot

   !> Records of contacts from one on, block by block.
   pure subroutine records(self, time, first, values)
      class(contact_row_type), intent(in) :: self
      real(wp), intent(in) :: time
      integer, intent(in) :: first
      real(wp), intent(out) :: values(:, :)

      integer :: block, number, done, start, last

      done = 0
      start = 0
      values = 0.0_wp
      do block = 1, size(self%block)
         number = self%block(block)%contacts%individual_count()
         last = min(start + number, first - 1 + size(values, 2))
         if (last >= first + done) then
            call self%block(block)%contacts%records(time, first + done - start, &
               & values(:contact_record_length, done + 1:last - first + 1))
            done = last - first + 1
         end if
         start = start + number
      end do
   end subroutine records

   subroutine exchange(self, archive)
      class(contact_row_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      integer :: block

      call archive%section("row of contacts")
      call archive%exchange("detached_count", self%detached_count)
      call archive%exchange("breaks", self%breaks)
      do block = 1, size(self%block)
         associate (one => self%block(block))
            call one%contacts%exchange(archive)
            call archive%exchange("block time", one%pose%time)
            call archive%exchange("block displacement", one%pose%displacement)
            call archive%exchange("block velocity", one%pose%velocity)
            call archive%exchange("block acceleration", one%pose%acceleration)
            call archive%exchange("block direction", one%pose%direction)
            call archive%exchange("block inverse_mass", one%pose%inverse_mass)
            call archive%exchange("block own_rate", one%pose%own_rate)
         end associate
      end do
   end subroutine exchange

   subroutine rebuild(self, displacement)
      class(contact_row_type), intent(inout) :: self
      real(wp), intent(in) :: displacement

      integer :: block

      do block = 1, size(self%block)
         call self%block(block)%contacts%rebuild(self%block(block)%pose%displacement)
      end do
      call self%gather()
   end subroutine rebuild

end module mesoslip_contacts_row
