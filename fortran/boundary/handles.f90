!> Handles of simulations, by which Python refers to them.
!>
!> A handle is the address of a simulation and a stamp that the simulation bears as well. Closing it
!> makes both zero, so that its use afterwards is an error.
module mesoslip_boundary_handles
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_intptr_t, c_loc, c_null_ptr, c_ptr
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid, status_ok
   use mesoslip_numerics_kinds, only: i8
   use mesoslip_numerics_parameters, only: name_length, parameters_type
   use mesoslip_loop_simulation, only: simulation_type
   implicit none
   private

   !> Characters of a message at the boundary
   integer, parameter :: message_length = 200

   public :: open_handle, close_handle, find_simulation, find_recipe, report
   public :: recipe_type
   ! For the procedures that Python calls.
   public :: error_type, simulation_type

   !> Stamp of every simulation, besides its address
   integer(i8), parameter :: stamp = int(z'6D65736F736C6970', i8)

   !> What contacts and slider of a simulation were made of: kinds, parameters, key of the random
   !> numbers; blank before.
   type :: recipe_type
      character(len=name_length) :: contacts = "", slider = ""
      type(parameters_type) :: contact_parameters, slider_parameters
      integer(i8) :: seed = 0_i8
   end type recipe_type

   !> A simulation with its stamp.
   type :: stamped_type
      integer(i8) :: stamp = 0_i8
      type(simulation_type) :: simulation
      type(recipe_type) :: recipe
   end type stamped_type

contains

   !> Set up a simulation without parts; the handle is zero if there is not enough memory.
   subroutine open_handle(handle)
      integer(i8), intent(out) :: handle(2)

      type(stamped_type), pointer :: stamped
      integer :: stat

      handle = 0_i8
      allocate (stamped, stat=stat)
      if (stat /= 0) return
      handle(1) = int(transfer(c_loc(stamped), 0_c_intptr_t), i8)
      handle(2) = ieor(stamp, handle(1))
      stamped%stamp = handle(2)
   end subroutine open_handle

   !> Free a simulation.
   subroutine close_handle(handle)
      !> The handle; zero afterwards
      integer(i8), intent(inout) :: handle(2)

      type(stamped_type), pointer :: stamped

      call find(handle, stamped)
      handle = 0_i8
      if (.not. associated(stamped)) return
      stamped%stamp = 0_i8
      deallocate (stamped)
   end subroutine close_handle

   !> The simulation of a handle.
   subroutine find_simulation(handle, whole, simulation, error)
      integer(i8), intent(in) :: handle(2)
      !> Whether it must have all its parts
      logical, intent(in) :: whole
      type(simulation_type), pointer, intent(out) :: simulation
      !> Set if it was closed, or a part is missing
      type(error_type), allocatable, intent(out) :: error

      type(stamped_type), pointer :: stamped

      simulation => null()
      call find(handle, stamped)
      if (.not. associated(stamped)) then
         call raise(error, status_invalid, "the simulation was closed")
         return
      end if
      simulation => stamped%simulation
      if (.not. whole) return
      if (.not. simulation%is_whole()) call raise(error, status_invalid, &
         & "the simulation lacks contacts, a slider, a drive, or what is to be recorded")
   end subroutine find_simulation

   !> What a simulation was made of; null if it was closed.
   subroutine find_recipe(handle, recipe)
      integer(i8), intent(in) :: handle(2)
      type(recipe_type), pointer, intent(out) :: recipe

      type(stamped_type), pointer :: stamped

      recipe => null()
      call find(handle, stamped)
      if (associated(stamped)) recipe => stamped%recipe
   end subroutine find_recipe

   !> The simulation of a handle; null if it was closed.
   subroutine find(handle, stamped)
      integer(i8), intent(in) :: handle(2)
      type(stamped_type), pointer, intent(out) :: stamped

      type(c_ptr) :: address

      stamped => null()
      if (handle(1) == 0_i8 .or. handle(2) /= ieor(stamp, handle(1))) return
      address = transfer(int(handle(1), c_intptr_t), c_null_ptr)
      call c_f_pointer(address, stamped)
      if (stamped%stamp /= handle(2)) stamped => null()
   end subroutine find

   !> Report an error, or success, to Python.
   subroutine report(error, status, message)
      type(error_type), allocatable, intent(in) :: error
      integer, intent(out) :: status
      character(len=message_length), intent(out) :: message

      status = status_ok
      message = ""
      if (.not. allocated(error)) return
      status = error%status
      message = error%message
   end subroutine report

end module mesoslip_boundary_handles
