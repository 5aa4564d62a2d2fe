! The random numbers as Python calls them, wrapped by f2py.

!> Philox 4x32-10, for tests and for other programs that need the same numbers.
subroutine philox(length, counter, key, word)
   !f2py threadsafe
   use mesoslip_numerics_random, only: philox4x32
   implicit none
   integer, intent(in) :: length
   !> 32-bit words in 64-bit integers, shapes (4, length), (2, length)
   integer(8), intent(in) :: counter(4, length), key(2, length)
   integer(8), intent(out) :: word(4, length)

   integer :: draw

   do draw = 1, length
      call philox4x32(counter(:, draw), key(:, draw), word(:, draw))
   end do
end subroutine philox

!> Relative strength g of the interface at displacements along the track of the slider.
subroutine track_strength(length, names, values, words, seed, realization, points, displacement, &
   & strength, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, report
   use mesoslip_numerics_parameters, only: new_parameters, parameters_type
   use mesoslip_track_strength, only: take_track_strength, track_strength_type
   implicit none
   integer, intent(in) :: length, points
   !> Parameters of the track by name, numbers or words
   character(len=32), intent(in) :: names(length), words(length)
   real(8), intent(in) :: values(length)
   !> Key of the random numbers
   integer(8), intent(in) :: seed, realization
   !> Displacements of the slider [m]
   real(8), intent(in) :: displacement(points)
   real(8), intent(out) :: strength(points)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(track_strength_type) :: track
   type(parameters_type) :: parameters
   type(error_type), allocatable :: error
   integer :: point

   call new_parameters(parameters, names, values, words)
   call take_track_strength(track, parameters, seed, realization, error)
   strength = 0.0d0
   if (.not. allocated(error)) then
      do point = 1, points
         strength(point) = track%relative_strength(displacement(point))
      end do
   end if
   call report(error, status, message)
end subroutine track_strength
