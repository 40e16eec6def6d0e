"""Light probes at several places of one scene: one light, consistent for every place."""
