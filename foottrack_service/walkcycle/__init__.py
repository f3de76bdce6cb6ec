"""Walk cycles: key poses in, a walk without foot slip out."""
