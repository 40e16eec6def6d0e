# Two commands are enough: `make demo` and `make test`. Both set up what they need first.
VENV := .venv
READY := $(VENV)/.relume-setup

# Where this is set, each process of the suite compiles tests and package anew, which takes ten seconds.
unexport PYTHONDONTWRITEBYTECODE

# One thread of linear algebra in each of the suite's processes: with more they wait for each other on two cores, which
# takes a third of the processor's time.
test quick: export OPENBLAS_NUM_THREADS := 1

# Three processes for two cores, for tests of servers and browsers wait; a file stays in one, the long ones first.
# NumPy's seeds are what each test sets. Nothing of ours logs, and to stand by for it takes a millisecond a test.
SUITE := $(VENV)/bin/pytest -q -n 3 --dist loadfile --no-loadscope-reorder --randomly-dont-reset-seed -p no:logging

.PHONY: demo test quick check bench docs

demo: $(READY)            ## insert the objects of examples/room and say where the pictures are
	$(VENV)/bin/relume demo -o out/demo

test: $(READY)            ## the whole suite, in an order of its own each time (-p no:randomly keeps the files' order)
	$(SUITE)

quick: $(READY)           ## for the inner loop: no render by Mitsuba, no whole command
	$(SUITE) -m "not slow and not long"

check: $(READY)           ## style, types, spelling; links and docstrings
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/codespell
	$(VENV)/bin/pyright
	scripts/check-page
	$(VENV)/bin/pytest -q tests/documents/test_pages.py tests/documents/test_docstrings.py

bench: $(READY)           ## speed, beside other programs: the table of docs/benchmarks.md, 40 minutes on two quiet cores
	$(VENV)/bin/python benchmarks/run_all.py --write docs/benchmarks.md

docs: $(READY)            ## the site, into out/docs; its lessons run
	$(VENV)/bin/python -c "import myst_nb, furo" 2>/dev/null || $(VENV)/bin/python -m pip install --quiet -e '.[docs]'
	$(VENV)/bin/python -m sphinx -W --keep-going -q -b html docs out/docs
	@echo "open out/docs/index.html"

# Set up again only when what is to be installed has changed.
$(READY): pyproject.toml scripts/setup
	scripts/setup
