"""Advisory locks between processes. Only POSIX has them; only daemons and changes by hand take them."""


def lock(handle: int, shared: bool = False, wait: bool = False) -> None:
    """Lock an open file until it is closed.

    Raises:
        BlockingIOError: another holds it, and `wait` is False.
    """
    import fcntl  # laboratories on other systems replay and report without it

    kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
    fcntl.flock(handle, kind if wait else kind | fcntl.LOCK_NB)
