# Everything on a Debian 12 or 13 machine that has git and make. `make` alone lists the targets.
PYTHON = .venv/bin/python
# By full path, like /usr/bin/python3 below: another MPI or Python may come first on PATH, and dolfinx belongs to these.
# A rank that fails leaves the others waiting for it: the time limit, in seconds, ends them.
MPIRUN = /usr/bin/mpirun --oversubscribe --timeout 2700

# Threads inside BLAS slow some solvers down a thousand times; ranks are the parallelism here.
export OMP_NUM_THREADS = 1
export OPENBLAS_NUM_THREADS = 1
# Open MPI refuses root otherwise, and on Debian 13 complains about network interfaces that one machine does not need
# (without tcp, ofi would look for others for a second, in every process).
export OMPI_ALLOW_RUN_AS_ROOT = 1
export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM = 1
export OMPI_MCA_btl = ^tcp,ofi
# Pictures without a screen.
export MPLBACKEND = Agg
export VTK_DEFAULT_OPENGL_WINDOW = vtkEGLRenderWindow
# A numpy in the user's own site directory would hide the distribution's.
export PYTHONNOUSERSITE = 1

# Two workers, each a process without MPI.
WORKERS = $(PYTHON) -m pytest -n 2 --dist worksteal

.PHONY: help setup packages demo animation motion heap knot gallery well string whirl recipes test slow docs tutorials tables figure3 work-precision benchmarks cosseratbench failures rods-in-wells folders tangles truths random random-wells random-strings imperfect mutants sanitizers release clean

help:
	@echo "Times are those of two idle cores and an empty cache of compiled forms, after \`make setup\`; beside other work they are two to three times as long."
	@echo "make demo    solve the eccentric cantilever of the paper on two processes; writes out/ (half a minute)"
	@echo "make animation  the animation at the top of the README: the column far past its limit load (a quarter of a minute)"
	@echo "make motion  seven motions, each a scene file, a picture and a number that must come out; writes out/ (half a minute)"
	@echo "make heap    thirty rods that fall on each other and come to rest; writes out/ (two minutes)"
	@echo "make knot    an overhand knot at rest under a pull; writes out/ (half a minute)"
	@echo "make gallery the scene files of demos/, each with a picture and a number that must come out; writes out/ (a minute)"
	@echo "make well    strings in wells: torque and drag, each with pictures and a number that must come out; writes out/wells/ (two minutes)"
	@echo "make string  drill-strings in motion: stick-slip, waves, a map of stability, each with pictures and numbers that must come out; writes out/strings/ (a minute)"
	@echo "make whirl   a collar in its hole from forward to backward whirl, and a map of whirl over speed and friction; writes out/whirl/ (three minutes)"
	@echo "make recipes the recipes of docs/recipes_*.md, and whether they print what is shown; writes out/recipes/ (a minute and a half)"
	@echo "make docs    the documentation as a site that needs no network; writes out/docs/index.html (a minute), and runs the programs of its pages (three minutes)"
	@echo "make tutorials  run the notebooks of docs/tutorials/ and store what they print and draw (a minute)"
	@echo "make test    the tests, but for those of \`make docs\` and \`make slow\`: on two workers, and on ranks (a quarter of an hour)"
	@echo "make slow    tests that take more than two seconds each (five minutes)"
	@echo "make tables  the tables of accuracy and cost in docs/, measured anew and put there"
	@echo "make figure3 every curve of the paper's Figure 3, and what was found; writes out/ (about 4 minutes)"
	@echo "make work-precision  speed against accuracy, beside Exudyn, OpenSeesPy, PyElastica, CalculiX, welleng and torque-drag (half an hour at most)"
	@echo "make benchmarks  published problems, each solved, drawn and compared with its printed numbers; writes out/benchmarks.md (a few minutes)"
	@echo "make cosseratbench  the scenarios of a public suite, cosseratbench, beside the results of other solvers (git gets it; ten minutes, nearly all for a rope that piles up)"
	@echo "make failures where methods fail: a map of methods against trials; writes out/ (at most a quarter of an hour)"
	@echo "make rods-in-wells  the exact rod in three wells, 40 random ones, and beyond buckling: steps, processor time, errors (about 8 minutes)"
	@echo "make truths  errors against closed forms and numbers of other programs, beside what was asked for (a few minutes)"
	@echo "make random  200 random scenes against the strong form, at three tolerances (about 5 minutes)"
	@echo "make random-wells  100 random wells, strings and operations against finer meshes in a stiffer wall (about half an hour)"
	@echo "make random-strings  200 random drill-strings in motion: energy, torque, small motions, steps, models (an hour)"
	@echo "make imperfect  60 symmetric structures with small imperfections against paths in small steps (about 20 minutes)"
	@echo "make mutants  120 small errors put into the code: how many do the tests find? (two hours)"
	@echo "make sanitizers  the tests on C that checks its bounds and what it leaves undefined (half an hour)"
	@echo "make release  the sdist, the wheel and the conda recipe, checked; writes dist/"
	@echo "make setup   only what all of these need first: the Debian packages and the environment .venv"
	@echo "make clean   remove .venv, out and whatever else was built here"

demo: setup
	$(MPIRUN) -n 2 $(PYTHON) demos/eccentric_cantilever.py

animation: setup
	$(PYTHON) demos/animation.py

motion: setup
	$(PYTHON) demos/motion.py

heap: setup
	$(PYTHON) demos/heap.py

knot: setup
	$(PYTHON) demos/knot.py

gallery: setup
	$(PYTHON) demos/gallery.py
	$(PYTHON) demos/frames.py

well: setup
	$(PYTHON) demos/wells.py

string: setup
	$(PYTHON) demos/strings.py
	$(MPIRUN) -n 2 $(PYTHON) demos/strings_map.py

whirl: setup
	$(PYTHON) demos/whirl.py --film
	$(MPIRUN) -n 2 $(PYTHON) demos/whirl_map.py

recipes: setup
	$(PYTHON) demos/recipes.py

# Warnings are errors. What Sphinx keeps between two builds lies beside the pages. Then the programs of the pages run.
docs: setup .venv/.docs
	$(PYTHON) -m sphinx -q -W --keep-going -j 2 -b html docs out/docs
	$(WORKERS) -m pages

tutorials: setup
	$(PYTHON) demos/tutorials.py

# Tests that are slow and that each release of Debian could fail: .ci/run makes them on Debian 13.
slow: setup
	$(WORKERS) -m "slow and not once"

# Two workers that know nothing of each other, then two ranks, then four for what depends on how many there are.
# pytest's cache directory is off in parallel: the ranks would write it all at once.
test: setup
	$(WORKERS) -m "not pages and (once or not slow)"
	$(MPIRUN) -n 2 $(PYTHON) -m pytest -p no:cacheprovider --color=no -m "not serial and not ranks and not slow"
	$(MPIRUN) -n 4 $(PYTHON) -m pytest -p no:cacheprovider --color=no -m ranks

tables: setup
	$(PYTHON) demos/evidence/accuracy.py
	$(PYTHON) demos/evidence/overhead.py
	$(PYTHON) demos/evidence/cases.py
	$(PYTHON) demos/evidence/first_runs.py
	$(PYTHON) demos/evidence/rungs.py
	$(PYTHON) demos/evidence/choice.py
	$(PYTHON) demos/evidence/scaling.py
	$(PYTHON) demos/evidence/many_rods.py
	$(PYTHON) demos/evidence/million_cases.py
	$(PYTHON) demos/evidence/ranks.py
	$(PYTHON) demos/evidence/steps.py
	$(PYTHON) demos/evidence/wall_in_motion.py
	$(PYTHON) demos/evidence/orders.py
	$(PYTHON) demos/evidence/put_in_docs.py accuracy overhead cases first_runs rungs choice scaling many_rods million_cases ranks steps wall_in_motion orders

# What an interrupted run has finished is kept: the same command goes on from there.
figure3: setup
	$(PYTHON) demos/evidence/figure3.py
	$(PYTHON) demos/evidence/put_in_docs.py figure3

# The same; other programs take part where `make work-precision` has installed them.
failures: setup
	$(PYTHON) demos/evidence/failures.py
	$(PYTHON) demos/evidence/put_in_docs.py failures

# What an interrupted run has finished is kept here, too. A number that disagrees fails the target.
benchmarks: setup
	$(PYTHON) demos/benchmarks
	$(PYTHON) demos/evidence/put_in_docs.py benchmarks

rods-in-wells: setup
	$(PYTHON) demos/evidence/rods_in_wells.py
	$(PYTHON) demos/evidence/put_in_docs.py rods_in_wells

truths: setup
	$(PYTHON) demos/evidence/truths.py
	$(PYTHON) demos/evidence/put_in_docs.py truths
	$(PYTHON) demos/evidence/targets.py
	$(PYTHON) demos/evidence/put_in_docs.py targets

tangles: setup
	$(PYTHON) -m pytest tests/test_rod_contact.py tests/test_rods_in_motion.py -k passes_through --tangles 300

folders: setup
	$(PYTHON) -m pytest tests/test_store.py -k damaged_folders --mutations 200

random: setup
	$(PYTHON) tests/random_comparison.py 200

random-wells: setup
	$(PYTHON) tests/random_wells.py 100

random-strings: setup
	$(PYTHON) demos/evidence/random_strings.py

imperfect: setup
	$(PYTHON) tests/imperfect_structures.py 60

# Goes on where it was broken off; `$(PYTHON) demos/evidence/work_precision.py --fresh` forgets the samples that are there.
work-precision: setup
	$(PYTHON) demos/evidence/work_precision.py
	$(PYTHON) demos/evidence/work_precision_motion.py
	$(PYTHON) demos/evidence/soft_string.py
	$(PYTHON) demos/evidence/work_precision_string.py
	$(PYTHON) demos/evidence/put_in_docs.py work_precision work_precision_motion soft_string work_precision_string

cosseratbench: setup
	$(PYTHON) demos/evidence/cosseratbench_suite.py
	$(PYTHON) demos/evidence/put_in_docs.py cosseratbench

setup: .venv/.stamp

# What pip installs beside the package itself: extras of pyproject.toml.
EXTRAS = test
# dolfinx and petsc4py are compiled against the distribution's numpy and break with a newer one: pip may not replace it.
.venv/.stamp: pyproject.toml .ci/debian-packages.txt
	@$(MAKE) --no-print-directory packages
	/usr/bin/python3 -m venv --clear --system-site-packages .venv
	/usr/bin/python3 -c 'import numpy, scipy; print(f"numpy=={numpy.__version__}\nscipy=={scipy.__version__}")' \
	    > .venv/constraints.txt
	$(PYTHON) -m pip install --disable-pip-version-check --constraint .venv/constraints.txt --editable '.[$(EXTRAS)]'
	@touch $@

.venv/.docs: .venv/.stamp
	$(PYTHON) -m pip install --disable-pip-version-check --constraint .venv/constraints.txt --editable '.[docs]'
	@touch $@

packages:
	@missing=$$(for name in $$(sed 's/#.*//' .ci/debian-packages.txt); do \
	    dpkg-query --show --showformat='$${Status}' $$name 2>/dev/null | grep -q 'ok installed' || echo $$name; done); \
	[ -n "$$missing" ] || exit 0; \
	if [ $$(id -u) = 0 ]; then root=; elif command -v sudo >/dev/null; then root=sudo; else \
	    echo "Please have root install these Debian packages, then try again:" $$missing; exit 1; fi; \
	$$root apt-get update && $$root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends $$missing

mutants: setup
	$(PYTHON) -m pip install --disable-pip-version-check --constraint .venv/constraints.txt pytest-cov
	$(PYTHON) demos/evidence/mutants.py
	$(PYTHON) demos/evidence/put_in_docs.py mutants

sanitizers: setup
	$(PYTHON) demos/evidence/sanitizers.py

release: setup
	$(PYTHON) -m pip install --disable-pip-version-check --constraint .venv/constraints.txt --editable '.[release]'
	rm -rf dist
	$(PYTHON) -m build --outdir dist
	$(PYTHON) -m twine check --strict dist/*
	$(PYTHON) -c 'import rattler_build as r; print(r.Stage0Recipe.from_file("recipe/recipe.yaml").render())'
	sha256sum dist/*.tar.gz

clean:
	rm -rf .venv out build dist *.egg-info .pytest_cache docs/api
	find . -name __pycache__ -prune -exec rm -rf {} +
