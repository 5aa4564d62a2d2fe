!> What a block does to its neighbours beyond its published motion (section 16).
!>
!> The excess e of its neighbours over their published motions pulls a block by βe + νe', β and ν
!> being the spring and the damping between neighbours over the mass of a block. It moves by δ more,
!> δ'' = βe + νe' - Dδ' - Kδ, which integrals of e give to order t⁶ (t⁵ with ν). The memory of a
!> damper of the setup is left out, below 1e-12 of a breaking stretch. δ is added at the block's
!> next event and at the end of the step, with the losses along δ, and those of e' along the motion
!> of the block, integrated by parts. An end of its window the block reaches earlier by δ/v.
module mesoslip_sliders_interface_excess
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_interface_polynomials, only: evaluate, max_order, moments
   use mesoslip_sliders_interface_state, only: add_exactly, excess_type, neighbour_motion, &
      & row_state_type
   implicit none
   private

   public :: note_excess, receive, receive_all

   !> Part of the time since a block's last event by which its crossing is moved at most
   real(wp), parameter :: max_part = 0.1_wp

   !> Response of a block to an excess: displacement δ, velocity, integral of δ, and the increase of
   !> the excess itself, with its integrals
   type :: response_type
      real(wp) :: shift = 0.0_wp, kick = 0.0_wp, area = 0.0_wp
      type(excess_type) :: increase
   end type response_type

contains

   !> Excess of both neighbours together at a block's own time.
   pure function around_block(self, block) result(total)
      class(row_state_type), intent(in) :: self
      integer, intent(in) :: block
      type(excess_type) :: total

      real(wp) :: part(0:3), time
      integer :: neighbour

      do neighbour = max(1, block - 1), min(self%blocks, block + 1)
         if (neighbour == block .or. .not. self%block(neighbour)%exceeds) cycle
         time = self%moment(block) - self%moment(neighbour)
         call moments(self%excess(:, neighbour), self%block(neighbour)%own_order, time, part)
         associate (once => self%excess_once(neighbour), twice => self%excess_twice(neighbour))
            total%value = total%value + part(0)
            total%once = total%once + once + part(1)
            total%twice = total%twice + twice + time * once + part(2)
            total%thrice = total%thrice + self%excess_thrice(neighbour) &
               & + time * (twice + 0.5_wp * time * once) + part(3)
         end associate
      end do
   end function around_block

   !> Take the excess of the neighbours as known up to a block's own time.
   subroutine note_excess(self, block)
      class(row_state_type), intent(inout) :: self
      integer, intent(in) :: block

      self%known(block) = around_block(self, block)
      self%known_moment(block) = self%moment(block)
   end subroutine note_excess

   !> Response of a block to the excess around it since it was last known.
   pure function response_of(self, block, now, time) result(response)
      class(row_state_type), intent(in) :: self
      integer, intent(in) :: block
      type(excess_type), intent(in) :: now
      !> Time since then [s]
      real(wp), intent(in) :: time
      type(response_type) :: response

      real(wp) :: drag, stiffness

      drag = self%law_drag(block) * self%inverse_mass + self%neighbours(block) * self%viscosity &
         & + self%damping
      stiffness = self%neighbours(block) * self%bond + self%pull(block) &
         & + self%law_stiffness(block) * self%inverse_mass
      associate (known => self%known(block), more => response%increase, &
         & shift => response%shift, area => response%area)
         more%value = now%value - known%value
         more%once = now%once - known%once - time * known%value
         more%twice = now%twice - known%twice - time * (known%once + 0.5_wp * time * known%value)
         more%thrice = now%thrice - known%thrice - time * (known%twice + 0.5_wp * time &
            & * (known%once + time * known%value / 3.0_wp))
         area = self%bond * (more%thrice + time**3 * known%value / 6.0_wp) &
            & + self%viscosity * more%twice
         shift = self%bond * (more%twice + 0.5_wp * time**2 * known%value) &
            & + self%viscosity * more%once
         response%kick = self%bond * (more%once + time * known%value) &
            & + self%viscosity * more%value - drag * shift + (drag**2 - stiffness) * area
         shift = shift - drag * area
      end associate
   end function response_of

   !> Add the losses of a response, velocity and acceleration of both neighbours together being
   !> given.
   subroutine add_losses_of(self, block, response, speed_around, acceleration_around)
      class(row_state_type), intent(inout) :: self
      integer, intent(in) :: block
      type(response_type), intent(in) :: response
      real(wp), intent(in) :: speed_around, acceleration_around

      real(wp) :: along, acceleration

      acceleration = 2.0_wp * self%bend(block)
      associate (speed => self%speed(block), shift => response%shift, area => response%area, &
         & more => response%increase)
         along = 2.0_wp * (speed * shift - acceleration * area)
         self%drag_part = self%drag_part + self%law_drag(block) * self%inverse_mass * along
         self%damping_part = self%damping_part &
            & + (self%damper(block) + self%damping * speed) * shift + self%viscosity &
            & * (self%neighbours(block) * along - speed_around * shift &
            & + acceleration_around * area - more%value * speed + more%once * acceleration &
            & - more%twice * self%jerk(block) + more%thrice * self%snap(block))
         self%pulled_once = self%pulled_once + self%pull(block) * area
         self%pulled_lever = self%pulled_lever + self%pull(block) * area * self%moment(block)
         self%damper(block) = self%damper(block) + self%damping * response%kick
      end associate
   end subroutine add_losses_of

   !> Add to the motion of a block what its neighbours have done beyond their published motions.
   subroutine receive(self, block, crosses)
      class(row_state_type), intent(inout) :: self
      integer, intent(in) :: block
      !> Whether it is at an end of its window, where it stays
      logical, intent(in) :: crosses

      type(response_type) :: response
      real(wp) :: around(0:1), time
      type(excess_type) :: now

      now = around_block(self, block)
      response = response_of(self, block, now, self%moment(block) - self%known_moment(block))
      around = 0.0_wp
      if (self%viscosity > 0.0_wp) call motion_around(self, block, around)
      call add_losses_of(self, block, response, around(0), around(1))
      self%excess_once(block) = self%excess_once(block) + response%area
      associate (place => self%place(block), speed => self%speed(block), shift => response%shift)
         time = 0.0_wp
         if (.not. crosses) then
            call shift_block(self, block, shift)
         else if (abs(speed) > 0.0_wp .and. abs(shift) <= max_part * self%span(block) &
            & * abs(speed)) then
            time = min(-shift / speed, self%length - self%moment(block))
            self%pulled_once = self%pulled_once + self%pull(block) * place * time
            self%pulled_lever = self%pulled_lever + self%pull(block) * place * time &
               & * self%moment(block)
            self%drag_part = self%drag_part + self%law_drag(block) * self%inverse_mass &
               & * speed**2 * time
            self%damping_part = self%damping_part + (self%damper(block) + self%viscosity &
               & * (self%neighbours(block) * speed - around(0))) * speed * time
         end if
         speed = speed + response%kick + 2.0_wp * self%bend(block) * time
         self%moment(block) = self%moment(block) + time
      end associate
      self%known(block) = now
      self%known_moment(block) = self%moment(block)
   end subroutine receive

   !> Velocity and acceleration of both neighbours together at a block's own time, as published.
   pure subroutine motion_around(self, block, motion)
      class(row_state_type), intent(in) :: self
      integer, intent(in) :: block
      real(wp), intent(out) :: motion(0:1)

      real(wp) :: around(0:max_order), value, bend

      around(:self%order) = neighbour_motion(self, block, self%order)
      call evaluate(around, self%order, self%moment(block), value, motion(0), bend)
      motion(1) = 2.0_wp * bend
   end subroutine motion_around

   !> The same for all blocks at the end of the step.
   subroutine receive_all(self, excess)
      class(row_state_type), intent(inout) :: self
      !> Displacement of each block beyond the published one [m]
      real(wp), intent(in) :: excess(:)

      type(response_type) :: response(self%blocks)
      real(wp), dimension(self%blocks) :: shift, area, near, further
      type(excess_type) :: now(self%blocks)
      integer :: block

      now%value = beside(excess)
      now%once = beside(self%excess_once)
      now%twice = beside(self%excess_twice)
      now%thrice = beside(self%excess_thrice)
      near = beside(self%speed)
      further = 2.0_wp * beside(self%bend)
      do block = 1, self%blocks
         response(block) = response_of(self, block, now(block), self%length &
            & - self%known_moment(block))
         call add_losses_of(self, block, response(block), near(block), further(block))
      end do
      ! To their neighbours blocks that move by δ more are an excess again.
      shift = self%viscosity * beside(response%shift)
      area = beside(response%area)
      self%damping_part = self%damping_part &
         & - sum(shift * self%speed - 2.0_wp * self%viscosity * area * self%bend)
      self%speed = self%speed + response%kick + shift + self%bond * area
      shift = response%shift + self%viscosity * area
      do block = 1, self%blocks
         call shift_block(self, block, shift(block))
      end do
   end subroutine receive_all

   !> Move a block within its window.
   subroutine shift_block(self, block, shift)
      class(row_state_type), intent(inout) :: self
      integer, intent(in) :: block
      !> The displacement [m]
      real(wp), intent(in) :: shift

      associate (place => self%place(block), remainder => self%place_remainder(block), &
         & window => self%block(block)%window)
         call add_exactly(place, remainder, remainder + shift)
         if (place <= window%upper .and. place >= window%lower) return
         place = max(window%lower, min(window%upper, place))
         remainder = 0.0_wp
      end associate
   end subroutine shift_block

   !> Sum over the neighbours of each block.
   pure function beside(values)
      real(wp), intent(in) :: values(:)
      real(wp) :: beside(size(values))

      beside(1) = 0.0_wp
      beside(2:) = values(:size(values) - 1)
      beside(:size(values) - 1) = beside(:size(values) - 1) + values(2:)
   end function beside

end module mesoslip_sliders_interface_excess
