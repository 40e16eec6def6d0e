"""The main job: a shot file and photographs in, a composite out."""
