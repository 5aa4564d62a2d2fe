!> Sites of contacts, which are in contact while the normal load is high enough.
!>
!> Each site has a height, uniform between 0 and 1 by a draw of its own. It is in contact while the
!> height is not above the share of the sites that the load brings into contact. In the order of
!> the heights, the sites in contact are the first ones.
module mesoslip_contacts_individual_sites
   use mesoslip_contacts_base, only: contact_parameters_type
   use mesoslip_contacts_individual_sorting, only: sort
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_random, only: uniform_pair
   implicit none
   private

   public :: contact_sites_type, new_contact_sites

   !> Renewal that no contact reaches, of which the draws are those of heights
   integer(i8), parameter :: height_renewal = 2_i8**48 - 1_i8

   !> Sites in the order of their heights.
   type :: contact_sites_type
      !> Number of sites in contact
      integer :: count = 0
      !> Time at which the next one touches or separates, or the load takes its next piece [s]
      real(wp) :: next_time = huge(1.0_wp)
      !> Heights in increasing order, and the sites that have them
      real(wp), allocatable, private :: height(:)
      integer, allocatable, private :: site(:)
      !> Piece of the load, and whether it has begun: a piece may begin with a jump
      integer, private :: piece = 1
      logical, private :: has_begun = .true.
      !> What happens next: a site touches, or separates, or neither
      logical, private :: touches_next = .false., separates_next = .false.
   contains
      !> The site of an order, the next event, and the first ones of a piece, some of which happen
      procedure, non_overridable :: site_at, take_next, preview, take_previewed
      procedure, non_overridable :: exchange
      procedure, non_overridable, private :: find_next
   end type contact_sites_type

contains

   !> Set up the sites under the load at the start.
   subroutine new_contact_sites(self, parameters, error)
      type(contact_sites_type), intent(out) :: self
      type(contact_parameters_type), intent(in) :: parameters
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      integer :: site, stat
      real(wp) :: uniform(2), share

      self%count = parameters%count
      if (.not. parameters%load%changes) return
      allocate (self%height(parameters%count), stat=stat)
      if (stat == 0) allocate (self%site(parameters%count), stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the sites of contacts")
         return
      end if
      do site = 1, parameters%count
         call uniform_pair(parameters%seed, parameters%realization, int(site - 1, i8), &
            & height_renewal, 0_i8, uniform)
         self%height(site) = uniform(1)
         self%site(site) = site
      end do
      call sort(self%height, self%site, parameters%count)
      share = parameters%load%share_at_start(1)
      do while (self%count > 0)
         if (self%height(self%count) <= share) exit
         self%count = self%count - 1
      end do
      call self%find_next(parameters)
   end subroutine new_contact_sites

   !> The site of an order by height, from 1.
   pure function site_at(self, order) result(site)
      class(contact_sites_type), intent(in) :: self
      integer, intent(in) :: order
      integer :: site

      site = self%site(order)
   end function site_at

   !> Let the next event happen.
   subroutine take_next(self, parameters, site, touches)
      class(contact_sites_type), intent(inout) :: self
      type(contact_parameters_type), intent(in) :: parameters
      !> The site that touches or separates; 0 if none does
      integer, intent(out) :: site
      !> Whether it touches
      logical, intent(out) :: touches

      site = 0
      touches = self%touches_next
      if (touches) then
         self%count = self%count + 1
         site = self%site(self%count)
      else if (self%separates_next) then
         site = self%site(self%count)
         self%count = self%count - 1
      else
         self%piece = self%piece + 1
         self%has_begun = .false.
      end if
      call self%find_next(parameters)
   end subroutine take_next

   !> The next sites that touch or separate.
   subroutine preview(self, parameters, limit, site, touches, time, number)
      class(contact_sites_type), intent(inout) :: self
      type(contact_parameters_type), intent(in) :: parameters
      !> Maximum number
      integer, intent(in) :: limit
      !> The sites, and whether each touches
      integer, intent(out) :: site(:)
      logical, intent(out) :: touches(:)
      !> Their times, followed by that of the next event [s]
      real(wp), intent(inout) :: time(:)
      !> Their number
      integer, intent(out) :: number

      integer :: count, piece
      logical :: has_begun

      count = self%count
      piece = self%piece
      has_begun = self%has_begun
      number = 0
      time(1) = self%next_time
      do while (number < limit .and. self%next_time < huge(1.0_wp))
         call self%take_next(parameters, site(number + 1), touches(number + 1))
         if (site(number + 1) == 0) exit
         number = number + 1
         time(number + 1) = self%next_time
      end do
      self%count = count
      self%piece = piece
      self%has_begun = has_begun
      call self%find_next(parameters)
   end subroutine preview

   !> Let the first sites touch or separate, which a preview returned.
   subroutine take_previewed(self, parameters, touches)
      class(contact_sites_type), intent(inout) :: self
      type(contact_parameters_type), intent(in) :: parameters
      !> Whether each touches
      logical, intent(in) :: touches(:)

      if (size(touches) == 0) return
      self%count = self%count + 2 * count(touches) - size(touches)
      call self%find_next(parameters)
   end subroutine take_previewed

   !> Find the next event: sites between two shares touch or separate in the order of heights.
   subroutine find_next(self, parameters)
      class(contact_sites_type), intent(inout) :: self
      type(contact_parameters_type), intent(in) :: parameters

      real(wp) :: share, height

      associate (load => parameters%load)
         do
            share = load%share_at_start(self%piece)
            if (self%has_begun) share = load%share_at_end(self%piece)
            self%touches_next = .false.
            self%separates_next = .false.
            if (self%count < size(self%site)) then
               height = self%height(self%count + 1)
               self%touches_next = height <= share
            end if
            if (self%count > 0 .and. .not. self%touches_next) then
               height = self%height(self%count)
               self%separates_next = height > share
            end if
            if (self%touches_next .or. self%separates_next .or. self%has_begun) exit
            self%has_begun = .true.
         end do
         if (.not. (self%touches_next .or. self%separates_next)) then
            self%next_time = load%piece_end(self%piece)
         else if (self%has_begun) then
            self%next_time = load%time_of(self%piece, height)
         else
            self%next_time = load%piece_end(self%piece - 1)
         end if
      end associate
   end subroutine find_next

   !> Write the state to an archive, or read it; without a changing load there is none.
   subroutine exchange(self, parameters, archive)
      class(contact_sites_type), intent(inout) :: self
      type(contact_parameters_type), intent(in) :: parameters
      type(archive_type), intent(inout) :: archive

      if (.not. parameters%load%changes) return
      call archive%exchange("sites_in_contact", self%count)
      call archive%exchange("load_piece", self%piece)
      call archive%exchange("load_piece_has_begun", self%has_begun)
      if (.not. (archive%saving .or. allocated(archive%failure))) call self%find_next(parameters)
   end subroutine exchange

end module mesoslip_contacts_individual_sites
