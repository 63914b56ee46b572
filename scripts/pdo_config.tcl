# pdo_config: default logging TPDOs for a Gen4-like motor controller, in Tcl with the DVT's own words.
#
# It does what pdo_config.dvt does (which explains the frames and says more): after it the node sends four TPDOs on
# every SYNC while it is OPERATIONAL.
#
# Run it    dvtcli --sim gen4 run scripts/pdo_config.tcl                          without hardware
#           dvtcli -i socketcan -c can0 -n 1 run scripts/pdo_config.tcl --dry-run  only look what it does
#
# Every word answers OK, a value, "Abort 0x..." or Timeout, and `must` stops the script where it is not what is wanted.
# Each sdo_wnx is checked, read back and journalled by dvtcli; `undo --all` at the prompt takes them back.

set node 1

# Object, sub-index and length in bits of what each frame holds, lowest byte first.
set frames {
    1 {{0x606C 0 32} {0x6077 0 16} {0x6041 0 16}}
    2 {{0x5100 1 16} {0x5100 2 16} {0x5100 3 16} {0x5100 4 8}}
    3 {{0x2620 0 16} {0x6C01 1 16} {0x6C01 2 16} {0x6800 1 8} {0x6800 2 8}}
    4 {{0x6C01 3 16} {0x6C01 4 16} {0x6C01 5 16}}
}

proc must {answer what} {
    if {$answer ne "OK"} {
        puts stderr "$what: $answer"
        exit 1
    }
}

# The whole sequence for one TPDO: disable, type and timers, count 0, the entries, the count, enable.
proc map_tpdo {node number entries} {
    set communication [expr {0x1800 + $number - 1}]
    set mapping [expr {0x1A00 + $number - 1}]
    set cob [expr {0x180 + ($number - 1) * 0x100 + $node}]
    must [sdo_wnx $node $communication 1 [format 0x%08X [expr {$cob | 0x80000000}]]] "disable TPDO$number"
    must [sdo_wnx $node $communication 2 0x01] "TPDO$number on every SYNC"   ;# transmission type 1
    must [sdo_wnx $node $communication 3 0x0000] "inhibit time of TPDO$number"
    must [sdo_wnx $node $communication 5 0x0000] "event timer of TPDO$number"
    must [sdo_wnx $node $mapping 0 0x00] "open the mapping of TPDO$number"
    set count 0
    foreach entry $entries {
        lassign $entry index sub bits
        incr count
        must [sdo_wnx $node $mapping $count [format 0x%04X%02X%02X $index $sub $bits]] "entry $count of TPDO$number"
    }
    must [sdo_wn $node $mapping 0 $count 1] "close the mapping of TPDO$number"
    must [sdo_wnx $node $communication 1 [format 0x%08X $cob]] "enable TPDO$number"
    puts "TPDO$number: $count objects on COB-ID [format 0x%03X $cob]"
}

# Another maker's device ends the script here, before anything is written.
if {[sdo_rnx $node 0x1018 1] ne "0x0000001E"} {
    puts stderr "node $node is another maker's device; nothing was written"
    exit 6
}

foreach {number entries} $frames {
    map_tpdo $node $number $entries
}

# SYNC sets the pace of every node: it is shown and not changed (bit 30 of 0x1005: this node produces it).
puts "SYNC: 0x1005 is [sdo_rnx $node 0x1005 0], period [sdo_rn $node 0x1006 0] us"

# There is no `store` here, on purpose: look at the frames first. Then add it to your own copy of this script.
