"""The command `compare`: filtered, unfiltered and refined maps of a workspace."""
