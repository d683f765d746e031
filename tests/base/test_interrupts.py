"""Ctrl-C arrives, whatever is being imported."""

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
from deferred_ir.base import interrupts
try:
    with interrupts.patient():
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


def test_an_interrupt_outside_imports_comes_at_once():
    code = (
        "import os, signal; from deferred_ir.base import interrupts\n"
        "try:\n"
        "    with interrupts.patient(): os.kill(os.getpid(), signal.SIGINT)\n"
        "except KeyboardInterrupt: print('at once')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=25)
    assert done.stdout == "at once\n"


def test_a_working_library_is_not_interrupted():
    code = (
        "import os, signal, sys; from deferred_ir.base import interrupts\n"
        "library = {'__name__': 'library', 'os': os, 'signal': signal}\n"
        "exec('''def work():\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "    return sum(1 for _ in range(100000))''', library)\n"
        "done = None\n"
        "try:\n"
        "    with interrupts.patient():\n"
        "        done = library['work']()\n"
        "        while True: pass\n"
        "except KeyboardInterrupt: print('worked', done)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=25)
    assert done.stdout == "worked 100000\n", done.stderr


def test_handlers_are_restored_and_no_interrupt_is_lost():
    code = (
        "import os, signal; from deferred_ir.base import interrupts\n"
        "before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGALRM)\n"
        "library = {'__name__': 'library', 'os': os, 'signal': signal}\n"
        "exec('def work(): os.kill(os.getpid(), signal.SIGINT)', library)\n"
        "try:\n"
        "    with interrupts.patient(): library['work']()\n"
        "except KeyboardInterrupt: print('interrupted')\n"
        "print((signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGALRM)) == before)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=25)
    assert done.stdout == "interrupted\nTrue\n", done.stderr
