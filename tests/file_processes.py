"""Each file of tests runs in a process of its own: what it loads and compiles is given back when the file is over.

A worker of pytest-xdist finds the tests and then copies itself for each file. The copy runs the tests as any worker
does; what it would tell the main process it tells its worker, who passes it on, and reports the copy's death.
"""

import multiprocessing
import signal
from contextlib import suppress
from importlib import import_module

import pytest

PATIENCE = 60.0
"""For the end of a process whose tests are over, s."""
STATE = ("testsfailed", "shouldfail", "shouldstop")
"""What a session counts and decides while tests run."""
LATE = ("dask.array",)
"""What every third file would load while it runs: loaded once, before."""


def how_it_ended(status):
    """What is wrong with a process's end, or nothing."""
    if status is None:
        return f"did not end within {PATIENCE:g} s"
    if status < 0:
        return f"was ended by {signal.Signals(-status).name}"
    return f"ended with status {status}" if status else ""


class Elsewhere:
    """In the worker nothing is left to do for a test."""

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self):
        return True


class FileProcesses:
    """Runs the tests of an xdist worker in copies of it, one for consecutive tests of a file."""

    def __init__(self, config):
        self.config = config
        self.process = self.connection = None
        self.worker = next(each for each in config.pluginmanager.get_plugins() if hasattr(each, "sendevent"))
        self.elsewhere = Elsewhere()
        config.pluginmanager.register(self.elsewhere)

    def pytest_collection_finish(self):
        for name in LATE:
            import_module(name)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item, nextitem):
        """Around everything else that is done for a test: the copy begins with nothing of it done."""
        if self.process is None:
            self._begin(item.session)
        goes_on = nextitem is not None and nextitem.path == item.path
        finished = self._run(item, goes_on)
        if not (finished and goes_on):
            died = self._end()
            if died or not finished:
                self._report(item, died or "ended before its test did")
        return (yield)

    def pytest_sessionfinish(self):
        """Where tests were to come when the session was stopped."""
        if self.process is not None:
            self._end()

    def _begin(self, session):
        self.config._tmp_path_factory.getbasetemp()  # emptied by who asks for it first: not by each copy
        fork = multiprocessing.get_context("fork")
        self.connection, other = fork.Pipe()
        self.process = fork.Process(target=self._serve, args=(session, other))
        self.process.start()
        other.close()

    def _run(self, item, goes_on):
        """Have a test run and pass on what is said of it; whether it was to its end."""
        following = self.worker.nextitem_index if goes_on else None
        with suppress(EOFError, OSError):
            self.connection.send((self.worker.item_index, following))
            while (told := self.connection.recv())[0] is not None:
                self.worker.sendevent(told[0], **told[1])
            for name, value in told[1].items():
                if value:
                    setattr(item.session, name, value)
            return True
        return False

    def _end(self):
        """Let the copy end; what is wrong with how it did, or nothing."""
        with suppress(OSError):
            self.connection.send(None)
        self.process.join(PATIENCE)
        status = self.process.exitcode
        if status is None:
            self.process.kill()
            self.process.join()
        self.connection.close()
        self.process = self.connection = None
        return how_it_ended(status)

    def _report(self, item, died):
        said = f"The process of {item.path.name} {died}."
        report = pytest.TestReport(item.nodeid, item.location, {}, "failed", said, "call")
        item.ihook.pytest_runtest_logreport(report=report)
        item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)

    def _serve(self, session, connection):
        """In the copy: run the tests that are asked for, and undo at the end what is left of the last."""
        self.connection.close()
        for plugin in (self, self.elsewhere):
            self.config.pluginmanager.unregister(plugin)
        self.worker.sendevent = lambda name, **said: connection.send((name, said))
        with suppress(KeyboardInterrupt, EOFError, BrokenPipeError):  # the worker ends too
            for index, following in iter(connection.recv, None):
                self.worker.item_index = index
                nextitem = None if following is None else session.items[following]
                self.config.hook.pytest_runtest_protocol(item=session.items[index], nextitem=nextitem)
                connection.send((None, {name: getattr(session, name) for name in STATE}))
        session._setupstate.teardown_exact(None)
