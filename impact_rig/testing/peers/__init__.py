"""Stand-ins for instruments, which speak their protocols over real sockets and terminals."""
