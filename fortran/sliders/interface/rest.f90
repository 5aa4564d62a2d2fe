!> The row at rest: where its blocks are in balance, and whether they ring no more.
module mesoslip_sliders_interface_rest
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_interface_series, only: drive_at
   use mesoslip_sliders_interface_state, only: rounding, row_state_type
   implicit none
   private

   public :: solve_static, try_rest

contains

   !> Where the blocks rest, and the velocities with which the drive takes them along, in balance of
   !> all forces but inertia and damping between neighbours.
   subroutine solve_static(self, drive, place, speed)
      class(row_state_type), intent(in) :: self
      !> Displacement and velocity of the drive
      real(wp), intent(in) :: drive(0:1)
      real(wp), intent(out) :: place(:), speed(:)

      real(wp), dimension(self%blocks) :: diagonal, drag
      integer :: n

      n = self%blocks
      associate (law => self%block%law)
         diagonal = self%neighbours * self%bond + self%pull + law%stiffness * self%inverse_mass
         drag = law%drag * self%inverse_mass + self%neighbours * self%viscosity
         speed = self%pull * drive(1) - law%rate * self%inverse_mass
         call solve_bonds(self%bond, diagonal, speed)
         place = self%pull * drive(0) + (law%offset + law%rate * self%offer_moment) &
            & * self%inverse_mass - drag * speed
      end associate
      place(2:) = place(2:) + self%viscosity * speed(:n - 1)
      place(:n - 1) = place(:n - 1) + self%viscosity * speed(2:)
      call solve_bonds(self%bond, diagonal, place)
   end subroutine solve_static

   !> Solve a system of a diagonal and equal bonds between neighbours.
   pure subroutine solve_bonds(bond, diagonal, values)
      real(wp), intent(in) :: bond, diagonal(:)
      !> Right-hand side, then the solution
      real(wp), intent(inout) :: values(:)

      real(wp) :: ratio(size(values)), pivot
      integer :: row

      pivot = diagonal(1)
      values(1) = values(1) / pivot
      do row = 2, size(values)
         ratio(row) = bond / pivot
         pivot = diagonal(row) - bond * ratio(row)
         values(row) = (values(row) + bond * values(row - 1)) / pivot
      end do
      do row = size(values) - 1, 1, -1
         values(row) = values(row) + ratio(row + 1) * values(row + 1)
      end do
   end subroutine solve_bonds

   !> Let the row rest if its ringing is below rounding: then all blocks move with the drive.
   subroutine try_rest(self)
      class(row_state_type), intent(inout) :: self

      real(wp) :: place(self%blocks), speed(self%blocks), drive(0:2), limit, tolerance
      integer :: block

      if (abs(self%drive%acceleration) > 0.0_wp) return
      drive = drive_at(self, 0.0_wp)
      call solve_static(self, drive(0:1), place, speed)
      limit = rounding * maxval(abs(place)) + self%tiny_displacement
      tolerance = maxval(self%block%law%tolerance)
      if (tolerance > 0.0_wp) limit = max(limit, tolerance / self%pinned_stiffness)
      if (any(abs(self%place - place) > limit)) return
      if (any(abs(self%speed - speed) > limit * sqrt(self%bond + self%pull(1) &
         & + self%pinned_stiffness * self%inverse_mass))) return
      do block = 1, self%blocks
         associate (window => self%block(block)%window)
            if (place(block) > window%upper .or. place(block) < window%lower) return
         end associate
      end do
      self%rests = .true.
      self%place = place
      self%place_remainder = 0.0_wp
      self%speed = speed
      self%bend = 0.0_wp
      self%damper = 0.0_wp
      self%order = 2
      self%published(:, 0) = place
      self%published(:, 1) = speed
      self%published(:, 2) = 0.0_wp
      self%published_damper(:, :1) = 0.0_wp
   end subroutine try_rest

end module mesoslip_sliders_interface_rest
