"""Everything with words and screens: argv, prompt, scripts, commands, text. Decides nothing about a device."""
