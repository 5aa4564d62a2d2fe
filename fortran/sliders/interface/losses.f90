!> Losses of blocks by drag and damping.
module mesoslip_sliders_interface_losses
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_interface_polynomials, only: max_order, points_for
   use mesoslip_sliders_interface_state, only: motion_of_damper, neighbour_motion, row_state_type
   implicit none
   private

   public :: add_losses, add_published_losses

contains

   !> Add the losses of a block in a part of the step.
   subroutine add_losses(self, block, series, order, step)
      class(row_state_type), intent(inout) :: self
      integer, intent(in) :: block, order
      real(wp), intent(in) :: series(0:max_order), step

      real(wp) :: drag, time, speed, deceleration, pull, square, damped
      real(wp) :: damper(0:max_order), around(0:max_order)
      integer :: points, node, term

      drag = self%block(block)%law%drag * self%inverse_mass
      if (.not. (drag > 0.0_wp .or. self%damping > 0.0_wp .or. self%viscosity > 0.0_wp)) return
      if (self%damping > 0.0_wp) damper = motion_of_damper(self, block, order)
      if (self%viscosity > 0.0_wp) then
         if (self%block(block)%is_own) then
            around(:order) = self%around(:order, block)
         else
            around(:order) = neighbour_motion(self, block, order)
         end if
      end if
      points = points_for(self%rate * step)
      square = 0.0_wp
      damped = 0.0_wp
      do node = 1, points
         time = self%rule(points)%point(node) * step
         speed = 0.0_wp
         do term = order, 1, -1
            speed = speed * time + term * series(term)
         end do
         associate (weight => self%rule(points)%weight(node))
            square = square + weight * speed**2
            if (self%damping > 0.0_wp) then
               deceleration = 0.0_wp
               do term = order - 1, 0, -1
                  deceleration = deceleration * time + damper(term)
               end do
               damped = damped + weight * deceleration * speed
            end if
            if (self%viscosity > 0.0_wp) then
               pull = 0.0_wp
               do term = order, 1, -1
                  pull = pull * time + term * around(term)
               end do
               damped = damped + weight * self%viscosity &
                  & * (self%neighbours(block) * speed - pull) * speed
            end if
         end associate
      end do
      self%drag_part = self%drag_part + drag * square * step
      self%damping_part = self%damping_part + damped * step
   end subroutine add_losses

   !> Add the losses of all blocks that go on as published in the step.
   subroutine add_published_losses(self, share)
      class(row_state_type), intent(inout) :: self
      !> 1 for a block that goes on as published, else 0
      real(wp), intent(in) :: share(:)

      real(wp), dimension(self%blocks) :: drag, speed, deceleration
      real(wp) :: time, square, damped
      integer :: points, node, term, n

      n = self%blocks
      drag = share * self%law_drag * self%inverse_mass
      if (.not. (any(drag > 0.0_wp) .or. self%damping > 0.0_wp .or. self%viscosity > 0.0_wp)) return
      points = points_for(self%rate * self%length)
      square = 0.0_wp
      damped = 0.0_wp
      do node = 1, points
         time = self%rule(points)%point(node) * self%length
         speed = 0.0_wp
         do term = self%order, 1, -1
            speed = speed * time + term * self%published(:, term)
         end do
         associate (weight => self%rule(points)%weight(node))
            square = square + weight * sum(drag * speed**2)
            deceleration = 0.0_wp
            if (self%damping > 0.0_wp) then
               do term = self%order - 1, 0, -1
                  deceleration = deceleration * time + self%published_damper(:, term)
               end do
            end if
            if (self%viscosity > 0.0_wp) then
               deceleration = deceleration + self%viscosity * self%neighbours * speed
               deceleration(2:) = deceleration(2:) - self%viscosity * speed(:n - 1)
               deceleration(:n - 1) = deceleration(:n - 1) - self%viscosity * speed(2:)
            end if
            damped = damped + weight * sum(share * deceleration * speed)
         end associate
      end do
      self%drag_part = self%drag_part + square * self%length
      self%damping_part = self%damping_part + damped * self%length
   end subroutine add_published_losses

end module mesoslip_sliders_interface_losses
