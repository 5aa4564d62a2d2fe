!> Lists of names that both sides of the boundary share: columns of tables, and names of kinds.
module mesoslip_boundary_names
   use mesoslip_contacts_ageing_law, only: ageing_names
   use mesoslip_contacts_base, only: contact_columns, snapshot_columns
   use mesoslip_contacts_mechanics, only: coupling_names, delay_names, initial_names
   use mesoslip_contacts_individual_neighbours, only: lattice_names
   use mesoslip_contacts_threshold_laws, only: law_names
   use mesoslip_loop_endings, only: ending_names
   use mesoslip_loop_state, only: energy_columns
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_parameters, only: name_length
   use mesoslip_recording_avalanches, only: avalanche_columns, snapshot_event_columns
   use mesoslip_recording_ruptures, only: rupture_columns
   use mesoslip_recording_slip_trace, only: slip_trace_columns
   use mesoslip_recording_slips, only: slip_columns
   use mesoslip_recording_stages, only: stage_columns
   use mesoslip_recording_trace, only: trace_columns
   use mesoslip_sliders_layered_system, only: solver_names
   use mesoslip_theory_lives, only: scale_names
   use mesoslip_theory_onset, only: equation_names, onset_columns
   implicit none
   private

   public :: find_names

contains

   !> A list of names.
   subroutine find_names(list, names, error)
      character(len=*), intent(in) :: list
      !> The names, all without blanks
      character(len=name_length), allocatable, intent(out) :: names(:)
      !> Set if there is no such list
      type(error_type), allocatable, intent(out) :: error

      select case (list)
      case ("trace")
         names = trace_columns
      case ("slip_trace")
         names = slip_trace_columns
      case ("slips")
         names = slip_columns
      case ("stages")
         names = stage_columns
      case ("ruptures")
         names = rupture_columns
      case ("avalanches")
         names = avalanche_columns
      case ("snapshot_events")
         names = snapshot_event_columns
      case ("snapshots")
         names = snapshot_columns
      case ("contacts")
         names = contact_columns
      case ("energy")
         names = energy_columns
      case ("endings")
         names = ending_names(1:)
      case ("couplings")
         names = coupling_names
      case ("delay_laws")
         names = delay_names
      case ("initial_states")
         names = initial_names
      case ("lattices")
         names = lattice_names
      case ("ageing_laws")
         names = ageing_names
      case ("threshold_laws")
         names = law_names
      case ("solvers")
         names = solver_names
      case ("onset")
         names = onset_columns
      case ("scales")
         names = scale_names
      case ("equations")
         names = equation_names
      case default
         call raise(error, status_invalid, "no list of names '" // list // "'")
      end select
   end subroutine find_names

end module mesoslip_boundary_names
