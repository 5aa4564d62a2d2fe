!> The normal load of populations: what touches and separates in a step.
!>
!> Sites touch in the order of their heights as the load rises, and the last ones separate first as
!> it falls. So a population is a mixture of sites in bins of heights. What touches in a step is a
!> population of its own, without a force; of what separates, all populations and the detached
!> contacts lose a part in the same bin. A step is so short that no more than a bin touches or
!> separates in it; jumps of the load are exact.
module mesoslip_contacts_populations_loading
   use mesoslip_contacts_populations_motion, only: position_at
   use mesoslip_contacts_populations_state, only: population_state_type
   use mesoslip_interface_law, only: interface_law_type, pose_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: set_up_load, begin_load, end_of_load_step, expected_change, add_load_changes, &
      & follow_load, jump_load

   !> Maximum share of the sites in a bin at resolution 1
   real(wp), parameter :: max_share = 0.1_wp
   !> Relative difference up to which a share is at the edge of a bin
   real(wp), parameter :: rounding = 1.0e-12_wp

contains

   !> Set up the bins of heights.
   subroutine set_up_load(self, error)
      class(population_state_type), intent(inout) :: self
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      integer :: stat

      if (.not. self%parameters%load%changes) return
      self%edge = self%parameters%load%edges(max_share * self%resolution)
      self%share = self%edge(size(self%edge))
      allocate (self%pinned%mix(self%bins(), size(self%pinned%population, 1)), source=0.0_wp, &
         & stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the heights of contacts")
         return
      end if
      self%pinned%newborn_mix = bin_parts(self, 0.0_wp, self%share)
      call self%detached%set_bins(self%bins(), error)
   end subroutine set_up_load

   !> Reduce the contacts of the start to those in contact.
   subroutine begin_load(self)
      class(population_state_type), intent(inout) :: self

      if (.not. self%parameters%load%changes) return
      call self%pinned%scale_all(self%share)
      call separate(self, self%parameters%load%share_at_start(1))
      self%share = self%parameters%load%share_at_start(1)
   end subroutine begin_load

   !> Parts of the sites between two shares that are in each bin.
   pure function bin_parts(self, low, high) result(parts)
      class(population_state_type), intent(in) :: self
      real(wp), intent(in) :: low, high
      real(wp) :: parts(self%bins())

      parts = max(0.0_wp, min(high, self%edge(2:)) - max(low, self%edge(:self%bins())))
      parts = parts / sum(parts)
   end function bin_parts

   !> Let contacts separate down to a share.
   subroutine separate(self, share)
      class(population_state_type), intent(inout) :: self
      real(wp), intent(in) :: share

      real(wp) :: before(size(self%edge) - 1), after(size(self%edge) - 1)

      associate (low => self%edge(:size(before)), high => self%edge(2:))
         before = max(0.0_wp, min(self%share, high) - low)
         after = max(0.0_wp, min(share, high) - low)
      end associate
      where (before > 0.0_wp) after = after / before
      call self%pinned%keep(after)
      call self%detached%keep(after)
   end subroutine separate

   !> Latest end of a step by the load [s].
   pure function end_of_load_step(self) result(time)
      class(population_state_type), intent(in) :: self
      real(wp) :: time

      real(wp) :: end_share
      integer :: bin

      time = huge(1.0_wp)
      associate (load => self%parameters%load, piece => self%load_piece)
         if (.not. load%changes) return
         time = load%piece_end(piece)
         end_share = load%share_at_end(piece)
         bin = bin_at(self, end_share)
         if (bin == 0) return
         if (end_share > self%share) then
            if (end_share > self%edge(bin + 1)) time = load%time_of(piece, self%edge(bin + 1))
         else
            if (end_share < self%edge(bin)) time = load%time_of(piece, self%edge(bin))
         end if
      end associate
   end function end_of_load_step

   !> The bin whose sites touch or separate next as the share changes to another; 0 if it does not.
   pure function bin_at(self, share) result(bin)
      class(population_state_type), intent(in) :: self
      real(wp), intent(in) :: share
      integer :: bin

      bin = 0
      if (share > self%share) then
         bin = count(self%edge <= self%share)
      else if (share < self%share) then
         bin = count(self%edge < self%share)
      end if
   end function bin_at

   !> Change of the share until a time of the present piece [s].
   pure function expected_change(self, time) result(change)
      class(population_state_type), intent(in) :: self
      real(wp), intent(in) :: time
      real(wp) :: change

      change = 0.0_wp
      if (self%parameters%load%changes) change = share_at(self, time) - self%share
   end function expected_change

   !> Share at a time of the present piece [s].
   pure function share_at(self, time) result(share)
      class(population_state_type), intent(in) :: self
      real(wp), intent(in) :: time
      real(wp) :: share

      integer :: nearest_edge

      associate (load => self%parameters%load, piece => self%load_piece)
         share = load%share_at_end(piece)
         if (time < load%piece_end(piece)) share = load%share_at(piece, time)
      end associate
      nearest_edge = minloc(abs(self%edge - share), 1)
      if (abs(self%edge(nearest_edge) - share) < rounding) share = self%edge(nearest_edge)
   end function share_at

   !> Add to a law the change of the force in a step by that of the share.
   pure subroutine add_load_changes(self, pose, change, span, moved, law)
      class(population_state_type), intent(in) :: self
      type(pose_type), intent(in) :: pose
      !> Change of the share, duration of the step [s] and displacement in it, signed [m]
      real(wp), intent(in) :: change, span, moved
      type(interface_law_type), intent(inout) :: law

      real(wp) :: slope, force, stiffness, offset, part
      integer :: bin

      if (change > 0.0_wp) then
         slope = 0.5_wp * self%pinned%touching_stiffness * change * self%parameters%count
         law%stiffness = law%stiffness + slope
         ! A chord that does the true work.
         law%offset = law%offset + slope * (pose%displacement + moved / 6.0_wp)
      else if (change < 0.0_wp .and. span > 0.0_wp) then
         bin = bin_at(self, self%share + change)
         call self%pinned%sum_bin(bin, stiffness, offset)
         part = change / (self%share - self%edge(bin))
         force = stiffness * (pose%displacement + moved) - offset
         law%rate = law%rate + part * force / span
      end if
   end subroutine add_load_changes

   !> Let contacts touch or separate in the last motion of the slider.
   subroutine follow_load(self, before, after)
      class(population_state_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      real(wp) :: share, time

      if (.not. self%parameters%load%changes) return
      share = share_at(self, after%time)
      if (.not. abs(share - self%share) > 0.0_wp) return
      time = self%parameters%load%mean_time(self%load_piece, before%time, after%time)
      call change_share(self, share, position_at(before, after, time), time, after)
   end subroutine follow_load

   !> Take the next piece of the load if the last one is over: it may begin with a jump.
   subroutine jump_load(self, after)
      class(population_state_type), intent(inout) :: self
      type(pose_type), intent(in) :: after

      if (.not. self%parameters%load%changes) return
      do while (after%time >= self%parameters%load%piece_end(self%load_piece))
         self%load_piece = self%load_piece + 1
         call change_share(self, self%parameters%load%share_at_start(self%load_piece), &
            & after%displacement, after%time, after)
      end do
   end subroutine jump_load

   !> Change the share at a mean displacement [m] and time [s].
   subroutine change_share(self, share, displacement, time, after)
      class(population_state_type), intent(inout) :: self
      real(wp), intent(in) :: share, displacement, time
      type(pose_type), intent(in) :: after

      real(wp) :: here, there, touching, factor

      if (share > self%share) then
         touching = (share - self%share) * self%parameters%count
         self%pinned%newborn_mix = bin_parts(self, self%share, share)
         factor = 1.0_wp
         if (self%pinned%has_track) factor = self%parameters%strength%factor(displacement)
         call self%pinned%touch(touching, factor, displacement, time, after%displacement, &
            & after%time, self%failure)
         ! The offered force includes theirs, but they had not moved before the step.
         call self%step_work%add(-0.5_wp * touching * self%pinned%touching_stiffness &
            & * (after%displacement - displacement)**2)
      else if (share < self%share) then
         there = self%pinned%elastic_energy(displacement)
         here = self%pinned%elastic_energy(after%displacement)
         call separate(self, share)
         there = there - self%pinned%elastic_energy(displacement)
         here = here - self%pinned%elastic_energy(after%displacement)
         call self%separation_loss%add(there)
         call self%step_work%add(here - there)
      end if
      self%share = share
   end subroutine change_share

end module mesoslip_contacts_populations_loading
