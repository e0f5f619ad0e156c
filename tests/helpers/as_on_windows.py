"""``python as_on_windows.py [ARGUMENT ...]``: studies.run, in a process whose own code finds Windows' modules only.

The code of this project sees another `sys.platform`, and modules without the names that Windows does not have; Python
itself and other packages, which run on Linux here, see the real ones. Worker processes import this file again, as
their main module, and are treated likewise.
"""

import builtins
import importlib
import pkgutil
import sys
from types import ModuleType

PACKAGES = ("heatwalk", "perturb", "studies", "conf")

MODULES = {"curses", "fcntl", "grp", "nis", "ossaudiodev", "posix", "pty", "pwd", "resource", "spwd", "syslog",
           "termios", "tty"}  # fmt: skip

NAMES = {
    "os": {
        "O_CLOEXEC", "O_DIRECTORY", "O_NOFOLLOW", "O_NONBLOCK", "O_SYNC", "O_TMPFILE", "WEXITSTATUS", "WIFEXITED",
        "WIFSIGNALED", "WNOHANG", "WTERMSIG", "chown", "chroot", "copy_file_range", "ctermid", "eventfd", "fchdir",
        "fchmod", "fchown", "fdatasync", "fork", "forkpty", "geteuid", "getegid", "getgid", "getgroups",
        "getloadavg", "getpgid", "getpgrp", "getpriority", "getresuid", "getsid", "getuid", "getxattr", "initgroups",
        "killpg", "lchmod", "lchown", "lockf", "major", "memfd_create", "minor", "mkfifo", "mknod", "nice",
        "openpty", "pathconf", "pidfd_open", "pipe2", "posix_fadvise", "posix_fallocate", "posix_spawn",
        "posix_spawnp", "pread", "preadv", "pwrite", "pwritev", "readv", "register_at_fork", "sched_getaffinity",
        "sched_setaffinity", "sched_yield", "sendfile", "setegid", "seteuid", "setgid", "setpgid", "setpriority",
        "setsid", "setuid", "setxattr", "splice", "statvfs", "sync", "sysconf", "tcgetpgrp", "tcsetpgrp", "ttyname",
        "uname", "wait", "wait3", "wait4", "waitid", "writev",
    },
    "signal": {
        "ITIMER_PROF", "ITIMER_REAL", "ITIMER_VIRTUAL", "SIGALRM", "SIGBUS", "SIGCHLD", "SIGCONT", "SIGHUP", "SIGIO",
        "SIGKILL", "SIGPIPE", "SIGPROF", "SIGQUIT", "SIGSTOP", "SIGSYS", "SIGTRAP", "SIGTSTP", "SIGTTIN", "SIGTTOU",
        "SIGUSR1", "SIGUSR2", "SIGVTALRM", "SIGWINCH", "SIG_BLOCK", "SIG_SETMASK", "SIG_UNBLOCK", "alarm",
        "getitimer", "pause", "pidfd_send_signal", "pthread_kill", "pthread_sigmask", "setitimer", "siginterrupt",
        "sigpending", "sigtimedwait", "sigwait", "sigwaitinfo",
    },
    "socket": {"AF_UNIX", "fromfd", "recv_fds", "send_fds", "socketpair"},
    "time": {"clock_gettime", "clock_settime", "pthread_getcpuclockid", "tzset"},
    "select": {"devpoll", "epoll", "kqueue", "poll"},
    "sys": set(),
}  # fmt: skip


class WithoutNames(ModuleType):
    """A module without some of its names."""

    def __init__(self, module, hidden):
        super().__init__(module.__name__, module.__doc__)
        self._module = module
        self._hidden = hidden
        if module is sys:
            self.platform = "win32"

    def __getattr__(self, name):
        if name in self._hidden:
            raise AttributeError(f"{self.__name__}.{name} does not exist on Windows")
        return getattr(self._module, name)


def is_ours(namespace):
    return ((namespace or {}).get("__name__") or "").partition(".")[0] in PACKAGES


def import_as_on_windows(name, globals=None, locals=None, fromlist=(), level=0):
    if not is_ours(globals):
        return original_import(name, globals, locals, fromlist, level)
    if name.partition(".")[0] in MODULES:
        raise ImportError(f"{name} does not exist on Windows")
    module = original_import(name, globals, locals, fromlist, level)
    hidden = NAMES.get(module.__name__)
    return module if hidden is None or level else WithoutNames(module, hidden)


original_import = builtins.__import__
if __name__ in ("__main__", "__mp_main__"):  # not where a test reads the names above
    builtins.__import__ = import_as_on_windows


def import_all():
    """Import every module of this project but those that are commands or need an optional package."""
    for package in PACKAGES:
        for module in pkgutil.walk_packages(importlib.import_module(package).__path__, f"{package}."):
            if module.name.rpartition(".")[2] not in ("__main__", "dask", "preload"):
                importlib.import_module(module.name)


if __name__ == "__main__":
    for name in [name for name in sys.modules if name.partition(".")[0] in PACKAGES]:
        del sys.modules[name]  # of an interpreter of the tests, which has imported some as they are
    import_all()
    from studies import run
    from studies.execution import fork_server
    from studies.storage import rows

    print("workers are started by:", fork_server.START_METHOD)
    print("the project sees os.fork:", hasattr(rows.os, "fork"))
    run.main()
