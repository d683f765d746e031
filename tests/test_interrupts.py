"""Ctrl-C arrives, whoever is importing what."""

import subprocess
import sys

GREEDY = """
import os, signal, time
try:
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.15)
    swallowed = False
except BaseException:
    swallowed = True
"""
MAIN = """
import sys, time
from deferred_ir import interrupts
interrupts.install()
try:
    import greedy
    time.sleep(30)
except KeyboardInterrupt:
    print("interrupted, with the module whole:", not greedy.swallowed, flush=True)
"""


def test_an_interrupt_during_an_import_waits_for_its_end(tmp_path):
    (tmp_path / "greedy.py").write_text(GREEDY)
    done = subprocess.run(
        [sys.executable, "-c", MAIN], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=25
    )
    assert done.stdout.splitlines() == ["interrupted, with the module whole: True"], done.stderr


def test_outside_imports_it_comes_at_once():
    code = (
        "import os, signal; from deferred_ir import interrupts; interrupts.install()\n"
        "try: os.kill(os.getpid(), signal.SIGINT)\n"
        "except KeyboardInterrupt: print('at once')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=25)
    assert done.stdout == "at once\n"
