!> The normal load over time, as the share of the sites that it brings into contact.
!>
!> More load means more contacts, not stronger ones: N L/L_0 of them at the load L. The share is
!> linear in each of some parts, and may jump between them, or it oscillates about a mean. Either
!> way it is a sequence of pieces in which it only rises or only falls.
module mesoslip_normal_load
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   implicit none
   private

   public :: normal_load_type, take_normal_load

   real(wp), parameter :: pi = acos(-1.0_wp)
   !> Number of shares up to which each is an edge of the bins of heights
   integer, parameter :: max_levels = 64

   !> A load in pieces.
   type :: normal_load_type
      !> Whether the load changes; otherwise all sites are in contact
      logical :: changes = .false.
      !> For each part its end [s], and the share at its start and at its end
      real(wp), allocatable, private :: part_end(:), start_share(:), end_share(:)
      !> Without parts, an oscillation: mean share, amplitude, rate [1/s], phase
      real(wp), private :: mean = 1.0_wp, amplitude = 0.0_wp, rate = 1.0_wp, phase = 0.0_wp
      !> Number of the half-period, from one turn to the next, in which an oscillation starts; it
      !> rises in even ones
      integer, private :: first_turn = 0
   contains
      !> End of a piece, numbered from 1 [s]
      procedure, non_overridable :: piece_end
      !> Share at the start and at the end of a piece, and at a time in it
      procedure, non_overridable :: share_at_start, share_at_end, share_at
      !> Time in a piece at which a share is reached
      procedure, non_overridable :: time_of
      !> Mean time of the change of the share between two times of a piece
      procedure, non_overridable :: mean_time
      !> Edges of bins of the heights of sites
      procedure, non_overridable :: edges
      procedure, non_overridable, private :: piece_start
   end type normal_load_type

contains

   !> Take a load from named parameters; without any it does not change.
   subroutine take_normal_load(self, parameters, error)
      type(normal_load_type), intent(out) :: self
      type(parameters_type), intent(inout) :: parameters
      !> Set if parameters are missing or do not fit
      type(error_type), allocatable, intent(inout) :: error

      logical :: fits

      fits = .true.
      if (allocated(error)) return
      if (parameters%has("load_part_end")) then
         call parameters%take("load_part_end", self%part_end, error)
         call parameters%take("load_start_share", self%start_share, error)
         call parameters%take("load_end_share", self%end_share, error)
         if (allocated(error)) return
         fits = size(self%start_share) == size(self%part_end) &
            & .and. size(self%end_share) == size(self%part_end)
         if (fits) fits = minval(self%start_share) >= 0.0_wp .and. minval(self%end_share) >= 0.0_wp
         self%changes = .true.
      else if (parameters%has("load_mean")) then
         call parameters%take("load_mean", self%mean, error)
         call parameters%take("load_amplitude", self%amplitude, error)
         call parameters%take("load_rate", self%rate, error)
         call parameters%take("load_phase", self%phase, error)
         if (allocated(error)) return
         fits = self%amplitude > 0.0_wp .and. self%mean >= self%amplitude .and. self%rate > 0.0_wp
         self%first_turn = floor(self%phase / pi + 0.5_wp)
         self%changes = .true.
      end if
      if (.not. fits) call raise(error, status_invalid, "the parts of a load do not fit each " &
         & // "other, or it falls below 0")
   end subroutine take_normal_load

   !> End of a piece [s]; huge for the last one.
   pure function piece_end(self, piece) result(time)
      class(normal_load_type), intent(in) :: self
      integer, intent(in) :: piece
      real(wp) :: time

      if (allocated(self%part_end)) then
         time = huge(1.0_wp)
         if (piece < size(self%part_end)) time = self%part_end(piece)
      else
         time = ((self%first_turn + piece) * pi - 0.5_wp * pi - self%phase) / self%rate
      end if
   end function piece_end

   !> Start of a piece [s].
   pure function piece_start(self, piece) result(time)
      class(normal_load_type), intent(in) :: self
      integer, intent(in) :: piece
      real(wp) :: time

      time = 0.0_wp
      if (piece > 1) time = self%piece_end(piece - 1)
   end function piece_start

   !> Whether an oscillation rises in a piece.
   pure function rises(self, piece)
      type(normal_load_type), intent(in) :: self
      integer, intent(in) :: piece
      logical :: rises

      rises = modulo(self%first_turn + piece - 1, 2) == 0
   end function rises

   !> Share at the start of a piece.
   pure function share_at_start(self, piece) result(share)
      class(normal_load_type), intent(in) :: self
      integer, intent(in) :: piece
      real(wp) :: share

      if (allocated(self%part_end)) then
         share = self%start_share(min(piece, size(self%part_end)))
      else if (piece == 1) then
         share = self%mean + self%amplitude * sin(self%phase)
      else
         share = self%mean + merge(-1.0_wp, 1.0_wp, rises(self, piece)) * self%amplitude
      end if
   end function share_at_start

   !> Share at the end of a piece.
   pure function share_at_end(self, piece) result(share)
      class(normal_load_type), intent(in) :: self
      integer, intent(in) :: piece
      real(wp) :: share

      if (allocated(self%part_end)) then
         share = self%end_share(min(piece, size(self%part_end)))
      else
         share = self%mean + merge(1.0_wp, -1.0_wp, rises(self, piece)) * self%amplitude
      end if
   end function share_at_end

   !> Share at a time in a piece [s].
   pure function share_at(self, piece, time) result(share)
      class(normal_load_type), intent(in) :: self
      integer, intent(in) :: piece
      real(wp), intent(in) :: time
      real(wp) :: share

      real(wp) :: start, part

      if (allocated(self%part_end)) then
         start = self%piece_start(piece)
         share = self%share_at_start(piece)
         if (self%piece_end(piece) >= huge(1.0_wp)) return
         part = (time - start) / (self%piece_end(piece) - start)
         share = share + min(1.0_wp, max(0.0_wp, part)) * (self%share_at_end(piece) - share)
      else
         share = self%mean + self%amplitude * sin(self%rate * time + self%phase)
      end if
   end function share_at

   !> Time in a piece at which a share is reached, which lies between those at its ends [s].
   pure function time_of(self, piece, share) result(time)
      class(normal_load_type), intent(in) :: self
      integer, intent(in) :: piece
      real(wp), intent(in) :: share
      real(wp) :: time

      real(wp) :: first, last, angle

      first = self%piece_start(piece)
      last = self%piece_end(piece)
      if (allocated(self%part_end)) then
         associate (start => self%share_at_start(piece), end => self%share_at_end(piece))
            time = first + (last - first) * ((share - start) / (end - start))
         end associate
      else
         angle = asin(max(-1.0_wp, min(1.0_wp, (share - self%mean) / self%amplitude)))
         if (.not. rises(self, piece)) angle = -angle
         time = ((self%first_turn + piece - 1) * pi + angle - self%phase) / self%rate
      end if
      time = min(max(time, first), last)
   end function time_of

   !> Mean time of the change of the share between two times of a piece [s].
   pure function mean_time(self, piece, first, last) result(time)
      class(normal_load_type), intent(in) :: self
      integer, intent(in) :: piece
      real(wp), intent(in) :: first, last
      real(wp) :: time

      real(wp) :: turn, start, angle, change

      time = 0.5_wp * (first + last)
      if (allocated(self%part_end)) return
      ! By parts, with angles from a turn, near which the mean of the share cancels.
      turn = (self%first_turn + piece) * pi - 0.5_wp * pi - self%phase
      start = self%rate * first - turn
      angle = self%rate * (last - first)
      change = cos(start + angle) - cos(start)
      if (.not. abs(change) > angle**3) return
      time = first + ((angle * cos(start + angle) - sin(start + angle) + sin(start)) / change) &
         & / self%rate
      time = min(max(time, first), last)
   end function mean_time

   !> Edges of bins of heights, from 0 on: the shares at which pieces end, and between those that a
   !> piece passes others not farther apart than a width.
   pure function edges(self, width)
      class(normal_load_type), intent(in) :: self
      real(wp), intent(in) :: width
      real(wp), allocatable :: edges(:)

      real(wp) :: low, high, level, next
      integer :: bins, bin

      if (allocated(self%part_end)) then
         low = min(minval(self%start_share), minval(self%end_share))
         high = max(maxval(self%start_share), maxval(self%end_share))
      else
         low = max(0.0_wp, self%mean - self%amplitude)
         high = self%mean + self%amplitude
      end if
      edges = [0.0_wp]
      if (low > 0.0_wp) edges = [edges, low]
      level = low
      do while (level < high)
         next = next_level(self, level, high)
         bins = 1
         if (is_passed(self, level, next)) bins = max(1, ceiling((next - level) / width))
         edges = [edges, (level + bin * (next - level) / bins, bin=1, bins - 1), next]
         level = next
      end do
   end function edges

   !> The next share above one at which a part starts or ends.
   pure function next_level(self, level, high) result(next)
      type(normal_load_type), intent(in) :: self
      real(wp), intent(in) :: level, high
      real(wp) :: next

      next = high
      if (.not. allocated(self%part_end)) return
      if (size(self%part_end) > max_levels) return
      next = min(high, minval(self%start_share, mask=self%start_share > level), &
         & minval(self%end_share, mask=self%end_share > level))
   end function next_level

   !> Whether a piece passes the shares between two.
   pure function is_passed(self, low, high)
      type(normal_load_type), intent(in) :: self
      real(wp), intent(in) :: low, high
      logical :: is_passed

      is_passed = .true.
      if (.not. allocated(self%part_end)) return
      is_passed = any(min(self%start_share, self%end_share) < high &
         & .and. max(self%start_share, self%end_share) > low &
         & .and. abs(self%end_share - self%start_share) > 0.0_wp)
   end function is_passed

end module mesoslip_normal_load
