"""One device over the two seams: reading it, changing it, storing. The only place that moves a device."""
