# Outputs of runs, curves and sweeps, and what is made of them. Included by the Makefile.

# The source's figures and claims, whose runs and scripts are in runs/source.
SOURCE := runs/source
named = $(patsubst $(SOURCE)/%.toml,out/%.nc,$(wildcard $(addprefix $(SOURCE)/,$(1))))

# Figures need the outputs of runs, but for S18, and two of other commands.
FIGURE_RUNS := $(filter-out out/S18.nc,$(call named,S*.toml limit-*.toml sizes-*.toml)) \
  out/avalanche.nc out/bundle.nc
ONSETS := out/S19a.onset.nc out/S19b.onset.nc
FIGURE_OUTPUTS := $(FIGURE_RUNS) out/S18.curve.nc $(ONSETS)
# Claims have runs and sweeps of their own, with several realizations, and use some of the figures'.
# The longest come first, so that two at a time end together.
CLAIM_OUTPUTS := $(sort $(call named,claims/delay-*.toml limit-6.toml)) \
  $(call named,claims/sweeps/*.toml claims/*.toml limit-*.toml) out/S18.curve.nc $(ONSETS)
SWEEPS := $(patsubst runs/%.toml,out/%.nc,$(wildcard runs/sweeps/*.toml runs/maps/*.toml))
MAPS := $(patsubst runs/%.toml,out/%.png,$(wildcard runs/maps/*.toml))

figures: $(FIGURE_OUTPUTS) | $(INSTALLED) ## Draw the source's figures into out/figures
	$(VENV)/bin/python $(SOURCE)/draw.py -o out/figures

claims: | $(INSTALLED) ## Judge the source's claims into out/claims.md, and compare with docs/claims.md
	@$(MAKE) --no-print-directory $(if $(findstring j,$(MAKEFLAGS)),,-j2) claim-outputs
	$(VENV)/bin/python $(SOURCE)/judge.py -o out/claims.md --compare docs/claims.md

.PHONY: claim-outputs
claim-outputs: $(CLAIM_OUTPUTS)

campaign: $(SWEEPS) $(MAPS) ## Run the sweeps of runs/sweeps and runs/maps, and draw the maps

# An output depends on its run and on what that is based on, not on the program: a build does not make
# hours of outputs stale. Expanded a second time, when the name of the output is known.
.SECONDEXPANSION:
# Looked up once, and only if an output is asked for.
chains = $(eval chains := $$(shell $(PYTHON) tools/bases runs))$(chains)
bases = $(patsubst $(1)>%,%,$(filter $(1)>%,$(chains)))

out/%.nc: runs/%.toml $$(call bases,runs/$$*.toml) | $(INSTALLED)
	$(MESOSLIP) run $< -o $@

out/%.nc: $(SOURCE)/%.toml $$(call bases,$(SOURCE)/$$*.toml) | $(INSTALLED)
	$(MESOSLIP) run $< -o $@

# A sweep keeps its points beside its output: what was interrupted goes on.
out/sweeps/%.nc: runs/sweeps/%.toml $$(call bases,runs/sweeps/$$*.toml) | $(INSTALLED)
	$(MESOSLIP) sweep $< -o $@

out/claims/sweeps/%.nc: $(SOURCE)/claims/sweeps/%.toml $$(call bases,$(SOURCE)/claims/sweeps/$$*.toml) | $(INSTALLED)
	$(MESOSLIP) sweep $< -o $@

out/maps/%.nc: runs/maps/%.toml $$(call bases,runs/maps/$$*.toml) | $(INSTALLED)
	$(MESOSLIP) sweep $< -o $@

out/%.curve.nc: runs/%.toml $$(call bases,runs/$$*.toml) | $(INSTALLED)
	$(MESOSLIP) curve $< -o $@

out/%.curve.nc: $(SOURCE)/%.toml $$(call bases,$(SOURCE)/$$*.toml) | $(INSTALLED)
	$(MESOSLIP) curve $< -o $@

out/%.onset.nc: runs/%.toml $$(call bases,runs/$$*.toml) | $(INSTALLED)
	$(MESOSLIP) onset $< -o $@

out/%.onset.nc: $(SOURCE)/%.toml $$(call bases,$(SOURCE)/$$*.toml) | $(INSTALLED)
	$(MESOSLIP) onset $< -o $@

out/%.png: out/%.nc | $(INSTALLED)
	$(MESOSLIP) plot $< -o $@

