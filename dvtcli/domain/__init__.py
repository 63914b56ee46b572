"""CANopen vocabulary and decisions: pure, standard library only; knows neither buses, files nor terminals."""
