"""From a log and its database to the proposal of a signal map."""
