!> Motions of blocks as series in time, by the equation of motion term by term (section 16).
module mesoslip_sliders_interface_series
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_interface_polynomials, only: max_order, move
   use mesoslip_sliders_interface_state, only: min_order, neighbour_motion, rounding, row_state_type
   use mesoslip_sliders_motion_series, only: inverse
   implicit none
   private

   public :: drive_at, expand, expand_all, expand_published, fastest_rate, shorten_step
   public :: whole_length

contains

   !> Bound on the rates of the row.
   pure function fastest_rate(self) result(rate)
      class(row_state_type), intent(in) :: self
      real(wp) :: rate

      rate = rate_of(self, maxval(abs(self%law_stiffness)), maxval(self%law_drag))
   end function fastest_rate

   !> Bound on the rates of a row whose blocks have contacts of a stiffness [N/m] and a drag [N s/m]
   !> at most.
   pure function rate_of(self, stiffness, drag) result(rate)
      class(row_state_type), intent(in) :: self
      real(wp), intent(in) :: stiffness, drag
      real(wp) :: rate

      rate = 2.0_wp * self%max_neighbours * self%bond + self%max_pull &
         & + max(stiffness, self%pinned_stiffness) * self%inverse_mass
      rate = sqrt(rate) + drag * self%inverse_mass + self%damping &
         & + 2.0_wp * self%max_neighbours * self%viscosity
   end function rate_of

   !> Shortest length, not below the given one, at which the end of the step is representable.
   !> Otherwise the drive would continue from a rounded time, and equal steps add work that no term
   !> of the energy has.
   pure function whole_length(self, length) result(whole)
      class(row_state_type), intent(in) :: self
      !> Length [s]
      real(wp), intent(in) :: length
      real(wp) :: whole

      whole = (self%time + length) - self%time
      if (whole < length) whole = nearest(self%time + length, 1.0_wp) - self%time
   end function whole_length

   !> End the step earlier if the contacts of a block have become so stiff or dragging that motions
   !> would not be exact up to its end, as where all of a block detach and their drag is large.
   subroutine shorten_step(self, block)
      class(row_state_type), intent(inout) :: self
      !> The block, at the time of the row's last event
      integer, intent(in) :: block

      real(wp) :: rate, length

      associate (law => self%block(block)%law)
         rate = rate_of(self, abs(law%stiffness), law%drag)
      end associate
      if (rate <= self%rate) return
      self%rate = rate
      length = whole_length(self, self%moment(block) + self%reach(self%order) / rate)
      if (length >= self%length) return
      self%length = length
      self%reaches_end = .false.
   end subroutine shorten_step

   !> Coefficients of the drive's displacement since a moment of the step.
   pure function drive_at(self, moment) result(drive)
      class(row_state_type), intent(in) :: self
      real(wp), intent(in) :: moment
      real(wp) :: drive(0:2)

      real(wp) :: rate, acceleration

      rate = self%drive%rate_at(self%base_time)
      acceleration = self%drive%acceleration
      drive(0) = self%drive%at(self%base_time) + (rate + 0.5_wp * acceleration * moment) * moment
      drive(1) = rate + acceleration * moment
      drive(2) = 0.5_wp * acceleration
   end function drive_at

   !> Motion of all blocks, by the equation of motion term by term.
   subroutine expand_all(self)
      class(row_state_type), intent(inout) :: self

      real(wp), dimension(self%blocks) :: stiffness, drag, force, offset
      real(wp) :: drive(0:2), push
      integer :: term, n

      n = self%blocks
      drive = drive_at(self, 0.0_wp)
      stiffness = self%neighbours * self%bond + self%pull &
         & + self%law_stiffness * self%inverse_mass
      drag = self%law_drag * self%inverse_mass + self%neighbours * self%viscosity
      offset = (self%block%law%offset + self%block%law%rate * self%offer_moment) * self%inverse_mass
      associate (series => self%published, damper => self%published_damper)
         damper(:, :1) = 0.0_wp
         damper(:, 0) = self%damper
         series(:, 0) = self%place
         series(:, 1) = self%speed
         do term = 0, self%order - 2
            force = -stiffness * series(:, term) - (term + 1) * drag * series(:, term + 1)
            if (self%damping > 0.0_wp) force = force - damper(:, term)
            if (term <= 2) force = force + self%pull * drive(term)
            if (term == 0) force = force + offset
            if (term == 1) force = force - self%block%law%rate * self%inverse_mass
            force(2:) = force(2:) + self%bond * series(:n - 1, term)
            force(:n - 1) = force(:n - 1) + self%bond * series(2:, term)
            if (self%viscosity > 0.0_wp) then
               push = self%viscosity * (term + 1)
               force(2:) = force(2:) + push * series(:n - 1, term + 1)
               force(:n - 1) = force(:n - 1) + push * series(2:, term + 1)
            end if
            series(:, term + 2) = force * (inverse(term + 1) * inverse(term + 2))
            if (self%damping > 0.0_wp) damper(:, term + 1) = self%damping * inverse(term + 1) &
               & * (force - damper(:, term))
         end do
      end associate
      self%bend = self%published(:, 2)
   end subroutine expand_all

   !> Motion of a block since its own time, under the published motion of its neighbours, up to
   !> about its next event.
   subroutine expand(self, block)
      class(row_state_type), intent(inout) :: self
      integer, intent(in) :: block

      real(wp) :: shown(0:max_order)
      integer :: kept

      call limit_horizon(self, block, kept)
      call expand_to(self, block, kept)
      self%block(block)%exceeds = self%blocks > 1
      if (.not. self%block(block)%exceeds) return
      shown(:self%order) = self%published(block, :self%order)
      call move(shown, self%order, self%moment(block), kept)
      self%excess(:kept, block) = self%own(:kept, block) - shown(:kept)
   end subroutine expand

   !> Publish the motion of a block: the same up to the end of the step.
   subroutine expand_published(self, block)
      class(row_state_type), intent(inout) :: self
      integer, intent(in) :: block

      real(wp) :: shown(0:max_order)
      integer :: kept

      call expand_to(self, block, self%order)
      shown(:self%order) = self%own(:self%order, block)
      call move(shown, self%order, -self%moment(block), self%order)
      self%published(block, :self%order) = shown(:self%order)
      self%block(block)%exceeds = .false.
      call limit_horizon(self, block, kept)
      self%block(block)%own_order = kept
   end subroutine expand_published

   !> The order of a block's motion up to about its next event, and until when it is exact.
   subroutine limit_horizon(self, block, kept)
      class(row_state_type), intent(inout) :: self
      integer, intent(in) :: block
      integer, intent(out) :: kept

      real(wp) :: step, gap
      integer :: order

      step = self%length - self%moment(block)
      self%horizon(block) = self%length
      if (self%speed(block) > 0.0_wp) then
         gap = self%block(block)%window%upper - self%place(block)
      else
         gap = self%place(block) - self%block(block)%window%lower
      end if
      if (gap < 0.5_wp * abs(self%speed(block)) * step .and. gap > 0.0_wp) then
         ! Not so short that time would stand still.
         step = max(2.0_wp * gap / abs(self%speed(block)), rounding * self%length)
         self%horizon(block) = self%moment(block) + step
      end if
      kept = self%order
      do order = min_order, self%order
         if (self%rate * step <= self%reach(order)) then
            kept = order
            exit
         end if
      end do
   end subroutine limit_horizon

   !> Motion of a block since its own time up to an order.
   subroutine expand_to(self, block, kept)
      class(row_state_type), intent(inout) :: self
      integer, intent(in) :: block, kept

      real(wp) :: around(0:max_order), damper, stiffness, drag, force
      real(wp) :: drive(0:2), series(0:max_order), offset
      integer :: term

      around(:self%order) = neighbour_motion(self, block, self%order)
      call move(around, self%order, self%moment(block), kept)
      drive = drive_at(self, self%moment(block))
      associate (law => self%block(block)%law)
         stiffness = self%neighbours(block) * self%bond + self%pull(block) &
            & + law%stiffness * self%inverse_mass
         drag = law%drag * self%inverse_mass + self%neighbours(block) * self%viscosity
         offset = (law%offset - law%rate * (self%moment(block) - self%offer_moment(block))) &
            & * self%inverse_mass
         series(0) = self%place(block)
         series(1) = self%speed(block)
         damper = self%damper(block)
         self%own_damper(0, block) = damper
         do term = 0, kept - 2
            force = self%bond * around(term) - stiffness * series(term) &
               & - (term + 1) * drag * series(term + 1) - damper
            if (self%viscosity > 0.0_wp) force = force &
               & + self%viscosity * (term + 1) * around(term + 1)
            if (term <= 2) force = force + self%pull(block) * drive(term)
            if (term == 0) force = force + offset
            if (term == 1) force = force - law%rate * self%inverse_mass
            series(term + 2) = force * (inverse(term + 1) * inverse(term + 2))
            damper = self%damping * (force - damper) * inverse(term + 1)
            self%own_damper(term + 1, block) = damper
         end do
         self%own(:kept, block) = series(:kept)
         self%bend(block) = series(2)
      end associate
      if (self%viscosity > 0.0_wp) self%around(:kept, block) = around(:kept)
      self%block(block)%own_order = kept
      self%block(block)%is_own = .true.
   end subroutine expand_to

end module mesoslip_sliders_interface_series
