// SPDX-License-Identifier: MIT
using System;

namespace SplatBus
{
    /// <summary>What came from the other side breaks a rule; the message names it and the place.</summary>
    public sealed class ProtocolException : Exception
    {
        /// <param name="what">A sentence, with the requirement in brackets.</param>
        /// <param name="offset">Where: a byte of the payload, or of the stream for a header.</param>
        public ProtocolException(string what, long offset) : base(what + " at byte " + offset)
        {
            Offset = offset;
        }

        /// <param name="pointer">Where: a JSON pointer into the message.</param>
        public ProtocolException(string what, string pointer) : base("'" + pointer + "' " + what)
        {
            Offset = -1;
        }

        /// <summary>The byte; -1 where a member is named instead.</summary>
        public long Offset { get; private set; }
    }
}
