"""Groups of commands of `brake-ecu`; each command imports what it needs when it is called."""
