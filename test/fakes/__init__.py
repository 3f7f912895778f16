"""Stand-ins for instruments, over real sockets and terminals."""
